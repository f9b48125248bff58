// Truth, odometry and GPS as references: every layout and rawlog stream gives back what went in.
#include <gtest/gtest.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/poses/CPose3DInterpolator.h>
#include <mrpt/serialization/CArchive.h>

#include <filesystem>
#include <fstream>

#include "libvio/base/angles.h"
#include "libvio/evaluation/evaluate.h"
#include "libvio/io/gz_stream.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/reference.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

constexpr TimeNs kStart = 1'600'000'000'000'000'000;

std::vector<TimedPose> path(int n = 20) {
    std::vector<TimedPose> poses;
    for (int i = 0; i < n; ++i) {
        const double u = 0.3 * i;
        poses.push_back({kStart + i * TimeNs{100'000'000},
                         {so3::exp({0.2 * std::sin(u), -0.3 * std::cos(u), 0.4 * u}),
                          {std::cos(u), 2 * std::sin(u), 0.1 * u}}});
    }
    return poses;
}

void expect_equal(const std::vector<TimedPose>& a, const std::vector<TimedPose>& b,
                  double tolerance, TimeNs time_tolerance = 0) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
        EXPECT_LE(std::abs(a[i].t - b[i].t), time_tolerance);
        EXPECT_LT(a[i].T_W_B.boxminus(b[i].T_W_B).norm(), tolerance) << i;
    }
}

class ReferenceFiles : public ::testing::Test {
 protected:
    std::string write(const std::string& name, const std::string& text) {
        std::ofstream(folder_ / name) << text;
        return folder_ / name;
    }

    std::string rawlog(const std::vector<Message>& messages) {
        RawlogWriter writer(folder_ / "x.rawlog", Rig{});
        for (const Message& message : messages) writer.write(message);
        writer.finish();
        return folder_ / "x.rawlog";
    }

    ScratchFolder folder_;
};

std::string kitti_row(const Pose& T) {
    std::string row;
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) row += format(T.R(r, c)) + " ";
        row += format(T.p(r)) + (r < 2 ? " " : "\n");
    }
    return row;
}

TEST_F(ReferenceFiles, KittiPosesAreReadWithTheirTimes) {
    std::string poses, times;
    for (const TimedPose& row : path()) {
        poses += kitti_row(row.T_W_B);
        times += format_seconds(row.t) + "\n";
    }
    const std::string file = write("07.txt", poses);
    EXPECT_NE(test::error_of([&] { read_trajectory(file); }).find("07.times.txt"),
              std::string::npos);
    write("times.txt", times);
    expect_equal(read_trajectory(file), path(), 1e-12);
    write("07.times.txt", times + "2000000000\n");
    EXPECT_NE(test::error_of([&] { read_trajectory(file); }).find("20 poses"), std::string::npos);
    write("07.times.txt", "3\n2\n");
    EXPECT_NE(test::error_of([&] { read_trajectory(file); }).find("(line 2)"), std::string::npos);
}

TEST_F(ReferenceFiles, MrptInterpolatorsOwnFileIsRead) {
    mrpt::poses::CPose3DInterpolator interpolator;
    for (const TimedPose& row : path())
        interpolator.insert(to_mrpt(row.t), to_mrpt(row.T_W_B).asTPose());
    ASSERT_TRUE(interpolator.saveToTextFile(folder_ / "path.txt"));
    // MRPT writes six decimals.
    expect_equal(read_trajectory(folder_ / "path.txt"), path(), 3e-6, 1000);
}

TEST_F(ReferenceFiles, RowsOfAnotherLayoutAreRefusedWithTheirPlace) {
    const std::string file = write("x.txt", "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0\n");
    EXPECT_NE(test::error_of([&] { read_trajectory(file); }).find("(line 2)"), std::string::npos);
    const std::string skewed = write("k.txt", "1 0 0 0 0 1 0 0 0 0 2 0\n");
    EXPECT_NE(test::error_of([&] { read_trajectory(skewed); }).find("no rotation"),
              std::string::npos);
}

TEST_F(ReferenceFiles, OdometryOfARawlog) {
    std::vector<Message> messages;
    std::vector<TimedPose> expected;
    for (TimedPose row : path()) {
        const double yaw = 0.7 * to_seconds(row.t - kStart);
        row.T_W_B = {so3::exp({0, 0, yaw}), {row.T_W_B.p.x(), row.T_W_B.p.y(), 0}};
        expected.push_back(row);
        messages.emplace_back(OdometryMessage{row.t, row.T_W_B});
        messages.emplace_back(ImuReading{row.t + 1000, {0, 0, 0}, {0, 0, 9.81}});
    }
    const std::string file = rawlog(messages);
    const Reference reference = read_reference(file + ":odometry");
    EXPECT_TRUE(reference.has_attitude);
    expect_equal(reference.poses, expected, 1e-12);
    EXPECT_NE(test::error_of([&] { read_reference(file + ":gps"); }).find("no GPS fix"),
              std::string::npos);
    EXPECT_NE(test::error_of([&] { read_reference(file); }).find(":odometry or"),
              std::string::npos);
}

TEST_F(ReferenceFiles, RepeatedOdometryStampsAreToldAndBackwardOnesRefused) {
    const auto with_stamps = [&](const std::vector<TimeNs>& stamps) {
        std::vector<Message> messages;
        for (const TimeNs t : stamps) messages.emplace_back(OdometryMessage{kStart + t, Pose{}});
        return rawlog(messages) + ":odometry";
    };
    const Reference reference = read_reference(with_stamps({0, 0, 100}));
    EXPECT_EQ(reference.poses.size(), 2u);
    ASSERT_EQ(reference.notes.size(), 1u);
    EXPECT_NE(reference.notes[0].find("1 reading"), std::string::npos);
    const std::string backwards = with_stamps({100, 0});
    EXPECT_NE(test::error_of([&] { read_reference(backwards); }).find("before"), std::string::npos);
}

// WGS84 written out: geodetic to earth-centred, then rotated into east, north, up at the origin.
Eigen::Vector3d earth_centred(double latitude, double longitude, double height) {
    const double a = 6378137.0, f = 1 / 298.257223563, e2 = f * (2 - f);
    const double s = std::sin(latitude), n = a / std::sqrt(1 - e2 * s * s);
    return {(n + height) * std::cos(latitude) * std::cos(longitude),
            (n + height) * std::cos(latitude) * std::sin(longitude), (n * (1 - e2) + height) * s};
}

Eigen::Vector3d east_north_up(const GpsMessage& fix, const GpsMessage& origin) {
    const double b = origin.latitude_deg * kDegree, l = origin.longitude_deg * kDegree;
    Eigen::Matrix3d R;
    R << -std::sin(l), std::cos(l), 0,  //
        -std::sin(b) * std::cos(l), -std::sin(b) * std::sin(l), std::cos(b),
        std::cos(b) * std::cos(l), std::cos(b) * std::sin(l), std::sin(b);
    return R *
           (earth_centred(fix.latitude_deg * kDegree, fix.longitude_deg * kDegree, fix.altitude_m) -
            earth_centred(b, l, origin.altitude_m));
}

TEST_F(ReferenceFiles, GpsFixesOfUsableQualityComeAsEastNorthUp) {
    std::vector<Message> messages;
    std::vector<GpsMessage> good;
    for (int i = 0; i < 12; ++i) {
        const GpsMessage fix{kStart + i * TimeNs{1'000'000'000}, -24.1 + 1e-4 * i * i,
                             -69.7 + 3e-4 * i, 2300.0 + i, i % 4 == 0 ? 0 : (i % 4 == 1 ? 2 : 1)};
        messages.emplace_back(fix);
        if (fix.fix_quality != 0) good.push_back(fix);
    }
    const std::string file = rawlog(messages);
    Reference reference = read_reference(file + ":gps");
    EXPECT_FALSE(reference.has_attitude);
    ASSERT_EQ(reference.poses.size(), good.size());
    // Earth-centred coordinates have 7 digits before the point: 1e-8 m is their rounding.
    for (size_t i = 0; i < good.size(); ++i)
        EXPECT_LT((reference.poses[i].T_W_B.p - east_north_up(good[i], good[0])).norm(), 1e-7);
    ASSERT_EQ(reference.notes.size(), 1u);
    EXPECT_NE(reference.notes[0].find("3 fixes"), std::string::npos);

    reference = read_reference(file + ":gps", {.gps_qualities = {2}, .gps_lever_arm = {}});
    EXPECT_EQ(reference.poses.size(), 3u);
    const ReferenceOptions none{.gps_qualities = {4}, .gps_lever_arm = {}};
    EXPECT_NE(test::error_of([&] { read_reference(file + ":gps", none); }).find("--gps-quality"),
              std::string::npos);
}

// The antenna sits off the body's origin; the rawlog's sensorPose says where.
TEST_F(ReferenceFiles, LeverArmOfTheAntennaIsAccountedFor) {
    const Eigen::Vector3d arm(0.4, -0.2, 1.1);
    const auto truth = path(40);
    const std::string file = folder_ / "arm.rawlog";
    {
        GzOutput out(file);
        auto archive = mrpt::serialization::archiveFrom(out);
        for (const TimedPose& row : truth) {
            // Near the equator a degree of latitude or longitude is inverted by small steps.
            GpsMessage fix{row.t, 0, 0, 0, 1};
            const GpsMessage origin = fix;
            const Eigen::Vector3d wanted = row.T_W_B * arm;
            for (int k = 0; k < 10; ++k) {
                const Eigen::Vector3d missing = wanted - east_north_up(fix, origin);
                fix.longitude_deg += missing.x() / 111319.49;
                fix.latitude_deg += missing.y() / 110574.0;
                fix.altitude_m += missing.z();
            }
            auto observation = to_mrpt(fix);
            observation.sensorPose = to_mrpt(Pose{Eigen::Matrix3d::Identity(), arm});
            archive << observation;
        }
        out.close();
    }
    const Reference reference = read_reference(file + ":gps");
    EXPECT_LT((reference.T_B_T.p - arm).norm(), 1e-12);
    EvaluationOptions options;
    options.T_B_T = reference.T_B_T;
    options.truth_has_attitude = reference.has_attitude;
    const Evaluation e = evaluate(truth, reference.poses, options);
    EXPECT_LT(e.position.max, 1e-6);
    EXPECT_EQ(e.rotation.count, 0);
    EXPECT_FALSE(e.drift.has_value());
    options.T_B_T = Pose{};
    EXPECT_GT(evaluate(truth, reference.poses, options).position.max, 0.01);
}

// Two receivers, or two odometers, are two sources: never one truth.
TEST_F(ReferenceFiles, OfSeveralSourcesOneIsTaken) {
    const std::string file = folder_ / "two.rawlog";
    {
        GzOutput out(file);
        auto archive = mrpt::serialization::archiveFrom(out);
        for (int i = 0; i < 10; ++i) {
            const TimeNs t = kStart + i * TimeNs{100'000'000};
            for (const bool roof : {true, false}) {
                auto fix =
                    to_mrpt(GpsMessage{t + (roof ? 0 : 1000), 1e-5 * i, roof ? 0.0 : 10.0, 0, 1});
                fix.sensorLabel = roof ? "roof" : "mast";
                fix.sensorPose = mrpt::poses::CPose3D(roof ? 1 : 2, 0, 0, 0, 0, 0);
                archive << fix;
                mrpt::obs::CObservationOdometry odometry;
                odometry.timestamp = to_mrpt(t + (roof ? 0 : 1000));
                odometry.sensorLabel = roof ? "wheels" : "scans";
                odometry.odometry = mrpt::poses::CPose2D(roof ? i : -i, 0, 0);
                archive << odometry;
            }
        }
        out.close();
    }
    for (const auto& [source, arm] :
         {std::pair{":gps", 1.0}, {":gps:roof", 1.0}, {":gps:mast", 2.0}}) {
        const Reference gps = read_reference(file + source);
        EXPECT_EQ(gps.poses.size(), 10u) << source;
        EXPECT_EQ(gps.T_B_T.p.x(), arm) << source;
        EXPECT_LT(gps.poses.back().T_W_B.p.norm(), 100) << "of one receiver only";
        EXPECT_EQ(gps.notes.size(), std::string(source) == ":gps" ? 1u : 0u);
    }
    const Reference first = read_reference(file + ":odometry");
    EXPECT_EQ(first.poses.back().T_W_B.p.x(), 9);
    EXPECT_FALSE(first.is_exact);
    ASSERT_EQ(first.notes.size(), 1u);
    EXPECT_NE(first.notes[0].find("'wheels' is taken; the others are 'scans'"), std::string::npos);
    EXPECT_EQ(read_reference(file + ":odometry:scans").poses.back().T_W_B.p.x(), -9);
    EXPECT_NE(test::error_of([&] {
                  read_reference(file + ":gps:deck");
              }).find("'deck'; there are 'mast', 'roof'"),
              std::string::npos);
    // Nor does a recording mix them.
    Recording recording(file);
    int fixes = 0, poses = 0;
    while (const auto message = recording.next()) {
        if (const auto* fix = std::get_if<GpsMessage>(&*message)) {
            ++fixes;
            EXPECT_EQ(fix->longitude_deg, 0);
        }
        if (const auto* odometry = std::get_if<OdometryMessage>(&*message)) {
            ++poses;
            EXPECT_GE(odometry->T_O_B.p.x(), 0);
        }
    }
    EXPECT_EQ(fixes, 10);
    EXPECT_EQ(poses, 10);
}

// One estimator against the other.
TEST_F(ReferenceFiles, ResultsFolderIsAReference) {
    Results results;
    for (const TimedPose& row : path()) {
        StateEstimate state;
        state.t = row.t;
        state.T_W_B = row.T_W_B;
        results.estimate.states.push_back(state);
    }
    write_results(folder_ / "other", results);
    const Reference reference = read_reference(folder_ / "other");
    expect_equal(reference.poses, path(), 1e-12);
    EXPECT_TRUE(reference.has_scale);
    EXPECT_FALSE(reference.is_exact);
    std::filesystem::create_directories(folder_ / "empty");
    EXPECT_NE(test::error_of([&] { read_reference(folder_ / "empty"); }).find("trajectory.tum"),
              std::string::npos);
}

}  // namespace
}  // namespace vio::test
