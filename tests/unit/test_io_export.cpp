// Exports come back from independent readers as they were.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/io/export.h"
#include "libvio/io/trajectory_io.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

Estimate made_estimate() {
    Estimate estimate;
    for (int i = 0; i < 120; ++i) {
        StateEstimate state;
        state.t = 1'403'636'584'763'555'584 + i * TimeNs{50'000'000};
        state.T_W_B = {so3::exp({0.03 * i, 0.2, -0.3}), {1.0 / 3 * i, 2, -0.5}};
        state.v_W = {0.1, 0.2 * i, 0.3};
        state.gyro_bias = {0.01, -0.02, 0.03};
        state.accel_bias = {0.1, 0.2, -0.3};
        estimate.states.push_back(state);
    }
    for (int j = 0; j < 9; ++j)
        estimate.landmarks.push_back(
            {j * 7, {1.0 / 7 * j, -2, 3}, 1e-3 * j * Eigen::Matrix3d::Identity(), 5 + j});
    return estimate;
}

std::string content(const std::string& file) {
    std::ifstream input(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(input), {}};
}

TEST(Export, KittiHoldsTheUpperThreeRowsOfEachPose) {
    const test::ScratchFolder folder;
    const Estimate estimate = made_estimate();
    write_kitti(folder / "poses.txt", estimate);
    std::ifstream file(folder / "poses.txt");
    std::string line;
    for (const StateEstimate& state : estimate.states) {
        ASSERT_TRUE(std::getline(file, line));
        std::istringstream row(line);
        for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 4; ++c) {
                double value = NAN;
                ASSERT_TRUE(row >> value);
                EXPECT_EQ(value, c < 3 ? state.T_W_B.R(r, c) : state.T_W_B.p(r));
            }
    }
    EXPECT_FALSE(std::getline(file, line));
}

TEST(Export, EurocReadsBackAsATrajectory) {
    const test::ScratchFolder folder;
    const Estimate estimate = made_estimate();
    write_euroc(folder / "data.csv", estimate);
    const auto back = read_trajectory(folder / "data.csv");
    ASSERT_EQ(back.size(), estimate.states.size());
    for (size_t i = 0; i < back.size(); ++i) {
        EXPECT_EQ(back[i].t, estimate.states[i].t);
        EXPECT_LT(back[i].T_W_B.boxminus(estimate.states[i].T_W_B).norm(), 1e-14);
    }
    const std::string text = content(folder / "data.csv");
    const std::string second = text.substr(text.find('\n') + 1);
    EXPECT_EQ(
        std::count(second.begin(), second.begin() + static_cast<long>(second.find('\n')), ','), 16)
        << "17 columns";
}

TEST(Export, VrmlHoldsPathLandmarksAndViewsAlongTheCameraAxes) {
    const test::ScratchFolder folder;
    const Estimate estimate = made_estimate();
    const Pose T_B_C{so3::exp({0.4, -1.0, 2.0}), {0.1, 0.2, 0.3}};
    write_vrml(folder / "scene.wrl", estimate, T_B_C);
    const std::string text = content(folder / "scene.wrl");
    EXPECT_EQ(text.rfind("#VRML V2.0 utf8\n", 0), 0u);
    EXPECT_EQ(std::count(text.begin(), text.end(), '{'), std::count(text.begin(), text.end(), '}'));
    std::istringstream words(text);
    std::vector<std::vector<double>> views;  // position, axis, angle
    for (std::string word; words >> word;) {
        if (word != "Viewpoint") continue;
        std::vector<double> view(7);
        words >> word >> word;  // { position
        for (int i = 0; i < 3; ++i) words >> view[static_cast<size_t>(i)];
        words >> word;  // orientation
        for (size_t i = 3; i < 7; ++i) words >> view[i];
        ASSERT_TRUE(words);
        views.push_back(view);
    }
    ASSERT_EQ(views.size(), 40u) << "every third of 120";
    const auto number = [&](size_t i) { return views[0][i]; };
    const Pose T_W_C = estimate.states[0].T_W_B * T_B_C;
    EXPECT_LT((Eigen::Vector3d(number(0), number(1), number(2)) - T_W_C.p).norm(), 1e-12);
    const Eigen::AngleAxisd turn(number(6), Eigen::Vector3d(number(3), number(4), number(5)));
    // A VRML camera looks along its -z axis, y up in the picture.
    EXPECT_LT((turn * -Eigen::Vector3d::UnitZ() - T_W_C.R.col(2)).norm(), 1e-12);
    EXPECT_LT((turn * Eigen::Vector3d::UnitY() + T_W_C.R.col(1)).norm(), 1e-12);
}

TEST(Export, BinaryPlyHoldsEveryLandmark) {
    const test::ScratchFolder folder;
    const Estimate estimate = made_estimate();
    write_binary_ply(folder / "map.ply", estimate);
    const std::string bytes = content(folder / "map.ply");
    const size_t begin = bytes.find("end_header\n") + 11;
    constexpr size_t kRow = 3 * sizeof(double) + 3;
    ASSERT_EQ(bytes.size(), begin + kRow * estimate.landmarks.size());
    for (size_t i = 0; i < estimate.landmarks.size(); ++i) {
        Eigen::Vector3d p;
        std::memcpy(p.data(), bytes.data() + begin + i * kRow, sizeof(p));
        EXPECT_EQ(p, estimate.landmarks[i].p_W);
    }
    const auto blue = [&](size_t i) {
        return static_cast<unsigned char>(bytes[begin + i * kRow + kRow - 1]);
    };
    EXPECT_GT(blue(0), blue(8)) << "the better known is bluer";
}

TEST(Export, CannotWriteIntoNothing) {
    EXPECT_THROW(write_kitti("/nonexistent/x", made_estimate()), InputError);
    EXPECT_THROW(write_vrml("/nonexistent/x", {}, {}), InputError);
}

}  // namespace
}  // namespace vio
