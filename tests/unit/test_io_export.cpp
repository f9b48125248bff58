// Exports come back from independent readers as they were.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>
#include <utility>
#include <vector>

#include "libvio/base/errors.h"
#include "libvio/io/export.h"
#include "libvio/io/ply.h"
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
    EXPECT_EQ(write_kitti(folder / "poses.txt", estimate), folder / "poses.times.txt");
    const auto again = read_trajectory(folder / "poses.txt");
    ASSERT_EQ(again.size(), estimate.states.size());
    for (size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(again[i].t, estimate.states[i].t);
        EXPECT_LT(again[i].T_W_B.boxminus(estimate.states[i].T_W_B).norm(), 1e-14);
    }
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

// The properties that a PLY's head names, in order, with their sizes.
std::vector<std::pair<std::string, size_t>> properties(const std::string& text) {
    std::vector<std::pair<std::string, size_t>> found;
    std::istringstream lines(text.substr(0, text.find("end_header")));
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string property, type, name;
        if (words >> property >> type >> name && property == "property")
            found.emplace_back(name, type == "double" ? 8 : type == "uchar" ? 1 : 4);
    }
    return found;
}

// The rows of a binary PLY file, in the places that its head says.
class BinaryPly {
 public:
    BinaryPly(const std::string& file, size_t rows) : bytes_(content(file)) {
        for (const auto& [name, size] : properties(bytes_))
            place_[name] = std::exchange(row_, row_ + size);
        begin_ = bytes_.find("end_header\n") + 11;
        EXPECT_EQ(bytes_.size(), begin_ + row_ * rows);
    }

    // Of row i; number: any of the property's type.
    template <typename Number>
    Number read(size_t i, const char* name, Number number) const {
        const size_t at = begin_ + i * row_ + place_.at(name);
        EXPECT_LE(at + sizeof number, bytes_.size());
        std::memcpy(&number, bytes_.data() + at, sizeof number);
        return number;
    }

 private:
    std::string bytes_;
    std::map<std::string, size_t> place_;
    size_t row_ = 0, begin_ = 0;
};

TEST(Ply, BinaryHoldsEveryNumberInTheOrderOfItsHead) {
    const test::ScratchFolder folder;
    const auto landmarks = made_estimate().landmarks;
    write_ply(folder / "map.ply", landmarks, LandmarkColour::kUncertainty, true);
    const BinaryPly ply(folder / "map.ply", landmarks.size());
    ASSERT_FALSE(HasFailure());
    const auto read = [&](size_t i, const char* name, auto number) {
        return ply.read(i, name, number);
    };
    for (size_t i = 0; i < landmarks.size(); ++i) {
        EXPECT_EQ(Eigen::Vector3d(read(i, "x", 0.), read(i, "y", 0.), read(i, "z", 0.)),
                  landmarks[i].p_W);
        EXPECT_EQ(read(i, "id", 0), landmarks[i].id);
        EXPECT_EQ(read(i, "observations", 0), landmarks[i].observations);
        EXPECT_EQ(read(i, "covariance_zz", 0.), landmarks[i].covariance(2, 2));
    }
    const std::uint8_t byte = 0;
    EXPECT_GT(read(0, "blue", byte), read(8, "blue", byte)) << "the better known is bluer";
    EXPECT_LT(read(0, "red", byte), read(8, "red", byte));
}

TEST(Ply, TextReadsBackToTheBitWithTheColoursOfTheImages) {
    const test::ScratchFolder folder;
    auto landmarks = made_estimate().landmarks;
    landmarks[3].rgb = {200, 100, 0};
    ASSERT_EQ(natural_colour(landmarks), LandmarkColour::kImage);
    write_ply(folder / "map.ply", landmarks, natural_colour(landmarks));
    const auto back = read_ply(folder / "map.ply");
    ASSERT_EQ(back.size(), landmarks.size());
    for (size_t i = 0; i < back.size(); ++i) {
        EXPECT_EQ(back[i].id, landmarks[i].id);
        EXPECT_EQ(back[i].p_W, landmarks[i].p_W);
        EXPECT_EQ(back[i].covariance, landmarks[i].covariance);
        EXPECT_EQ(back[i].observations, landmarks[i].observations);
    }
    EXPECT_EQ(*back[3].rgb, (Rgb{200, 100, 0}));
    EXPECT_EQ(*back[4].rgb, (Rgb{128, 128, 128})) << "not known";
    write_ply(folder / "map.ply", landmarks, LandmarkColour::kUncertainty);
    EXPECT_FALSE(read_ply(folder / "map.ply")[3].rgb);
}

// Ids of another tracker (hashes, stamps) fill 64 bits: none is cut, none changes its sign.
TEST(Ply, WideIdsStayWhole) {
    const test::ScratchFolder folder;
    auto landmarks = made_estimate().landmarks;
    ASSERT_GE(landmarks.size(), 7u);
    using Wide = std::numeric_limits<FeatureId>;
    const FeatureId ids[] = {
        Wide::min(), -1, 7, (FeatureId{1} << 32) + 7, FeatureId{1} << 31, 1'403'636'584'763'555'584,
        Wide::max()};
    for (size_t i = 0; i < 7; ++i) landmarks[i].id = ids[i];
    write_ply(folder / "map.ply", landmarks, LandmarkColour::kUncertainty);
    const auto back = read_ply(folder / "map.ply");
    ASSERT_EQ(back.size(), landmarks.size());
    for (size_t i = 0; i < back.size(); ++i) {
        EXPECT_EQ(back[i].id, landmarks[i].id);
        EXPECT_EQ(back[i].covariance, landmarks[i].covariance);
    }
    // In binary, as the head says.
    write_ply(folder / "binary.ply", landmarks, LandmarkColour::kUncertainty, true);
    const BinaryPly binary(folder / "binary.ply", landmarks.size());
    ASSERT_FALSE(HasFailure());
    for (size_t i = 0; i < landmarks.size(); ++i) {
        const auto low = binary.read(i, "id", std::uint32_t{0});
        const auto high = binary.read(i, "id_high", std::int32_t{0});
        EXPECT_EQ(high * 4294967296.0 + low, static_cast<double>(landmarks[i].id));
    }
    // Where all fit, the file is as ever.
    for (size_t i = 0; i < 7; ++i) landmarks[i].id = -static_cast<FeatureId>(i);
    write_ply(folder / "map.ply", landmarks, LandmarkColour::kUncertainty);
    EXPECT_EQ(content(folder / "map.ply").find("id_high"), std::string::npos);
    EXPECT_NE(content(folder / "map.ply").find("property int id\n"), std::string::npos);
    EXPECT_EQ(read_ply(folder / "map.ply")[6].id, -6);
}

TEST(Export, CannotWriteIntoNothing) {
    EXPECT_THROW(write_kitti("/nonexistent/x", made_estimate()), InputError);
    EXPECT_THROW(write_vrml("/nonexistent/x", {}, {}), InputError);
}

}  // namespace
}  // namespace vio
