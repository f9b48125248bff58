#include <gtest/gtest.h>
#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservationBearingRange.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DInterpolator.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <tuple>

#include "libvio/base/errors.h"
#include "libvio/camera/perspective.h"
#include "libvio/io/keyframe_spool.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/results.h"
#include "libvio/io/results_writer.h"
#include "libvio/io/text.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

Results made_results() {
    Results results;
    for (int i = 0; i < 5; ++i) {
        StateEstimate state;
        state.t = 1'403'636'584'763'555'584 + i * 50'000'000;
        state.T_W_B = {so3::exp({0.1 * i, 0.2, -0.3}), {1.0 / 3 * i, 2, -0.5}};
        state.v_W = {0.1, 0.2 * i, 0.3};
        state.gyro_bias = {0.01, -0.02, 0.03};
        state.accel_bias = {0.1, 0.2, -0.3};
        const Matrix15d A = Matrix15d::Random();
        state.covariance = 1e-4 * A * A.transpose();
        state.features = 10 + i;
        state.lost = i == 3;
        results.estimate.states.push_back(state);
        if (i > 1)
            results.estimate.innovations.push_back(
                {state.t, 20 + i, i, 4, 1, 0.7 / i, 41.5 + i, 40 + i, 0.1 * i, 6 * i});
        FeatureFrame frame{state.t, {}};
        for (int k = 0; k < 4; ++k)
            frame.features.push_back({3 * i + k, {10.5 * k, 20}, Eigen::Matrix2d::Identity()});
        results.keyframes.push_back(frame);
    }
    for (int j = 0; j < 3; ++j)
        results.estimate.landmarks.push_back(
            {j * 7, {1.0 / 7 * j, -2, 3}, 1e-3 * Eigen::Matrix3d::Identity(), 5 + j});
    results.estimate.g_W = {0, 0, -9.81};
    results.estimate.gravity_covariance = 1e-6 * Eigen::Matrix3d::Identity();
    results.rig.camera = std::make_shared<PerspectiveCamera>(
        PerspectiveParameters{640, 480, 500, 500, 320, 240, {}});
    results.options_ini = "[batch]\nsigma_px = 1\n";
    results.summary["estimator"] = "batch";
    return results;
}

TEST(Results, ComeBackAsTheyWereWritten) {
    const test::ScratchFolder scratch;
    const std::string folder = scratch / "out";
    const Results results = made_results();
    write_results(folder, results);
    const Estimate back = read_results(folder);
    ASSERT_EQ(back.states.size(), 5u);
    for (size_t i = 0; i < 5; ++i) {
        const StateEstimate &a = results.estimate.states[i], &b = back.states[i];
        EXPECT_EQ(a.t, b.t);
        EXPECT_LT(a.T_W_B.boxminus(b.T_W_B).norm(), 1e-14);
        EXPECT_EQ(a.v_W, b.v_W);
        EXPECT_EQ(a.gyro_bias, b.gyro_bias);
        EXPECT_EQ(a.accel_bias, b.accel_bias);
        EXPECT_TRUE((a.covariance.topLeftCorner<6, 6>().array() ==
                     b.covariance.topLeftCorner<6, 6>().array())
                        .all());
        EXPECT_LT((a.covariance.diagonal() - b.covariance.diagonal()).norm(), 1e-15);
        EXPECT_EQ(a.lost, b.lost);
        EXPECT_EQ(a.features, b.features);
    }
    ASSERT_EQ(back.innovations.size(), 3u);
    for (size_t i = 0; i < 3; ++i) {
        const ImageInnovations &a = results.estimate.innovations[i], &b = back.innovations[i];
        EXPECT_EQ(
            std::tie(a.t, a.landmarks, a.landmarks_rejected, a.new_points, a.new_points_rejected,
                     a.rms_px, a.normalised, a.dof, a.readings_normalised, a.readings_dof),
            std::tie(b.t, b.landmarks, b.landmarks_rejected, b.new_points, b.new_points_rejected,
                     b.rms_px, b.normalised, b.dof, b.readings_normalised, b.readings_dof));
    }
    ASSERT_EQ(back.landmarks.size(), 3u);
    EXPECT_EQ(back.landmarks[2].id, 14);
    EXPECT_EQ(back.landmarks[2].p_W, results.estimate.landmarks[2].p_W);
    EXPECT_EQ(back.landmarks[2].covariance, results.estimate.landmarks[2].covariance);
    EXPECT_EQ(back.g_W, results.estimate.g_W);
    EXPECT_TRUE(back.has_scale);
}

mrpt::poses::CPose3D pose_of(const StateEstimate& state) {
    return to_mrpt(state.T_W_B);
}

// Ids of 64 bits come back whole; MRPT's 32 bits name the landmark by its row then.
TEST(Results, WideFeatureIdsAreToldApart) {
    const test::ScratchFolder scratch;
    const std::string folder = scratch / "out";
    Results results = made_results();
    const auto widened = [](FeatureId id) { return id * 4294967296 - 5; };  // low halves all alike
    for (LandmarkEstimate& landmark : results.estimate.landmarks)
        landmark.id = widened(landmark.id);
    for (FeatureFrame& frame : results.keyframes)
        for (FeatureObservation& f : frame.features) f.feature_id = widened(f.feature_id);
    write_results(folder, results);
    const Estimate back = read_results(folder);
    ASSERT_EQ(back.landmarks.size(), 3u);
    for (size_t j = 0; j < 3; ++j) EXPECT_EQ(back.landmarks[j].id, widened(7 * j));
    mrpt::maps::CSimpleMap map;
    ASSERT_TRUE(map.loadFromFile(folder + "/keyframes.simplemap"));
    std::set<int> named;
    for (size_t i = 0; i < map.size(); ++i) {
        mrpt::poses::CPose3DPDF::Ptr pdf;
        mrpt::obs::CSensoryFrame::Ptr sensors;
        map.get(i, pdf, sensors);
        const auto sights = sensors->getObservationByClass<mrpt::obs::CObservationBearingRange>();
        for (const auto& sight : sights->sensedData) {
            named.insert(sight.landmarkID);
            const Eigen::Vector3d p_W =
                results.estimate.landmarks.at(static_cast<size_t>(sight.landmarkID)).p_W;
            EXPECT_NEAR(sight.range, (results.estimate.states[i].T_W_B.inverse() * p_W).norm(),
                        1e-5);
        }
    }
    EXPECT_EQ(named, (std::set<int>{0, 1, 2}));
}

// A disk that fills with the last bytes of the map, or of what it is made of: an error, and no map
// that looks complete.
TEST(Results, KeyframesOnAFullDiskAreTold) {
    const Results results = made_results();
    for (const char* full : {"map.simplemap.partial", "keyframes.partial"}) {
        const test::ScratchFolder scratch;
        std::filesystem::create_symlink("/dev/full", scratch / full);
        LandmarkSpool landmarks(scratch / "landmarks.partial");
        for (const LandmarkEstimate& landmark : results.estimate.landmarks) landmarks.add(landmark);
        landmarks.close();
        KeyframeSpool keyframes(scratch / "keyframes.partial", results.rig);
        for (size_t i = 0; i < 5; ++i)
            keyframes.add(results.keyframes[i], results.estimate.states[i]);
        const std::string error =
            test::error_of([&] { keyframes.finish(scratch / "map.simplemap", landmarks); });
        EXPECT_EQ(error, (scratch / full) + ": cannot be completed; is the disk full?");
        EXPECT_FALSE(std::filesystem::is_symlink(scratch / "map.simplemap")) << full;
        EXPECT_FALSE(std::filesystem::exists(scratch / "map.simplemap")) << full;
    }
}

// What a file lacks is an event, for people and scripts.
TEST(Results, MotionsLeftOutOfTheGraphAreTold) {
    const test::ScratchFolder scratch;
    Results results = made_results();
    for (size_t i = 0; i + 1 < 5; ++i) {
        const StateEstimate &a = results.estimate.states[i], &b = results.estimate.states[i + 1];
        results.estimate.keyframe_motions.push_back(
            {a.t, b.t, a.T_W_B.inverse() * b.T_W_B,
             i == 2 ? Matrix6d::Zero() : Matrix6d(1e-4 * Matrix6d::Identity())});
    }
    results.summary["events"].push_back({{"t_ns", 1}, {"text", "start"}});
    write_results(scratch / "out", results);
    const auto summary = nlohmann::json::parse(read_text(scratch / "out/summary.json"));
    ASSERT_EQ(summary["events"].size(), 2u);
    EXPECT_EQ(summary["events"][1]["t_ns"], results.estimate.states[2].t);
    EXPECT_EQ(summary["events"][1]["text"].get<std::string>().find(
                  "keyframes.graph: 1 motions between key-frames have no covariance"),
              0u)
        << summary["events"][1]["text"];
    EXPECT_TRUE(std::filesystem::exists(scratch / "out/keyframes.graph"));
}

TEST(Results, AreReadByMrpt) {
    const test::ScratchFolder scratch;
    const std::string folder = scratch / "out";
    const Results results = made_results();
    write_results(folder, results);
    size_t seen = 0;
    mrpt::maps::CSimpleMap map;
    ASSERT_TRUE(map.loadFromFile(folder + "/keyframes.simplemap"));
    ASSERT_EQ(map.size(), 5u);
    for (size_t i = 0; i < map.size(); ++i) {
        const StateEstimate& state = results.estimate.states[i];
        mrpt::poses::CPose3DPDF::Ptr pdf;
        mrpt::obs::CSensoryFrame::Ptr sensors;
        map.get(i, pdf, sensors);
        const PoseWithCovariance pose =
            from_mrpt(dynamic_cast<const mrpt::poses::CPose3DPDFGaussian&>(*pdf));
        EXPECT_LT(pose.pose.boxminus(state.T_W_B).norm(), 1e-12);
        EXPECT_LT((pose.covariance - state.covariance.topLeftCorner<6, 6>()).norm(), 1e-12);
        // Every program of MRPT's must know the classes: none of the project's own.
        const auto sights = sensors->getObservationByClass<mrpt::obs::CObservationBearingRange>();
        const auto cloud = sensors->getObservationByClass<mrpt::obs::CObservationPointCloud>();
        ASSERT_TRUE(sights && cloud && sensors->size() == 2);
        ASSERT_EQ(sights->sensedData.size(), cloud->pointcloud->size());
        for (size_t k = 0; k < sights->sensedData.size(); ++k) {
            const auto& sight = sights->sensedData[k];
            const LandmarkEstimate& landmark =
                results.estimate.landmarks.at(static_cast<size_t>(sight.landmarkID / 7));
            // Bearing: yaw to the left, pitch downwards, as MRPT's poses turn.
            const mrpt::poses::CPose3D turned(0, 0, 0, sight.yaw, sight.pitch, 0);
            const auto by_sight = (pose_of(state) + sights->sensorLocationOnRobot + turned)
                                      .composePoint(mrpt::math::TPoint3D(sight.range, 0, 0));
            float x = 0, y = 0, z = 0;
            cloud->pointcloud->getPoint(k, x, y, z);
            const auto by_cloud =
                (pose_of(state) + cloud->sensorPose).composePoint(mrpt::math::TPoint3D(x, y, z));
            for (const auto& p : {by_sight, by_cloud})  // stored in single precision
                EXPECT_LT((Eigen::Vector3d(p.x, p.y, p.z) - landmark.p_W).norm(), 2e-6);
        }
        seen += sights->sensedData.size();
    }
    EXPECT_EQ(seen, 3u) << "features 0, 7 and 14, each in one key-frame";
    mrpt::poses::CPose3DInterpolator path;
    ASSERT_TRUE(path.loadFromTextFile(folder + "/trajectory.txt"));
    ASSERT_EQ(path.size(), 5u);
    mrpt::maps::CSimplePointsMap points;
    ASSERT_TRUE(points.load3D_from_text_file(folder + "/landmarks.txt"));
    ASSERT_EQ(points.size(), 3u);
    for (size_t i = 0; i < 3; ++i) {
        float x = 0, y = 0, z = 0;
        points.getPoint(i, x, y, z);
        EXPECT_LT((Eigen::Vector3d(x, y, z) - results.estimate.landmarks[i].p_W).norm(), 1e-6);
    }
    const Pose last = from_mrpt(mrpt::poses::CPose3D(path.rbegin()->second));
    EXPECT_LT(last.boxminus(results.estimate.states.back().T_W_B).norm(), 1e-12);
}

TEST(Results, DoNotReplaceOthersUnlessAsked) {
    const test::ScratchFolder scratch;
    const std::string folder = scratch / "out";
    write_results(folder, made_results());
    std::ofstream(folder + "/mine.txt") << "kept";
    EXPECT_THROW(write_results(folder, made_results()), InputError);
    EXPECT_NO_THROW(write_results(folder, made_results(), true));
    EXPECT_TRUE(std::filesystem::exists(folder + "/mine.txt"));
    EXPECT_THROW(check_results_folder(folder + "/mine.txt", false), InputError);
}

TEST(Results, NamesInThemNeedNotBeUtf8) {
    const test::ScratchFolder scratch;
    Results results = made_results();
    results.summary["camera"] = "cam\xa3";
    write_results(scratch / "out", results);
    const auto json = nlohmann::json::parse(read_text(scratch / "out/summary.json"));
    EXPECT_EQ(json["camera"], "cam\xef\xbf\xbd");
}

TEST(Results, NameTheFileThatIsWrong) {
    const test::ScratchFolder scratch;
    const std::string folder = scratch / "out";
    EXPECT_THROW(read_results(folder), InputError);
    write_results(folder, made_results());
    std::ofstream(folder + "/states.csv") << "1,2,3\n";
    const std::string message = test::error_of([&] { read_results(folder); });
    EXPECT_NE(message.find("states.csv"), std::string::npos) << message;
}

// Read at any moment the files hold what has come until then, and the whole is the same whether it
// came at once or in pieces.
TEST(ResultsWriter, GrowsByValidRowsToTheSameFiles) {
    const test::ScratchFolder scratch;
    const Results results = made_results();
    write_results(scratch / "whole", results);
    ResultsWriter writer(scratch / "pieces", results.rig, results.options_ini, false);
    EXPECT_FALSE(std::filesystem::exists(scratch / "pieces/trajectory.tum"));
    Estimate piece = results.estimate;
    for (size_t i = 0; i < results.estimate.states.size(); ++i) {
        writer.add_keyframe(results.keyframes[i]);
        piece.states = {results.estimate.states[i]};
        piece.innovations.clear();
        if (i > 1) piece.innovations = {results.estimate.innovations[i - 2]};
        // Landmarks come when the estimator lets go of them, some a second time.
        piece.landmarks.clear();
        if (i == 0) piece.landmarks = {{14, {9, 9, 9}, Eigen::Matrix3d::Identity(), 1}};
        if (i == 2) piece.landmarks = {results.estimate.landmarks[2]};
        if (i == 3)
            piece.landmarks = {results.estimate.landmarks[0], results.estimate.landmarks[1]};
        writer.add(piece);
        const Estimate back = read_results(scratch / "pieces");
        ASSERT_EQ(back.states.size(), i + 1);
        EXPECT_EQ(back.states.back().lost, results.estimate.states[i].lost);
        EXPECT_TRUE(std::filesystem::exists(scratch / "pieces/trajectory_cov.txt"));
        EXPECT_FALSE(std::filesystem::exists(scratch / "pieces/summary.json"));
    }
    writer.finish(results.summary);
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(scratch / "whole")) {
        const std::string name = entry.path().filename();
        EXPECT_EQ(read_text(entry.path()), read_text(scratch / "pieces" + "/" + name)) << name;
        ++files;
    }
    EXPECT_EQ(files, 11);
    EXPECT_FALSE(std::filesystem::exists(scratch / "pieces/landmarks.partial"));
}

}  // namespace
}  // namespace vio
