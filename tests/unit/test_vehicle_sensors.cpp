// Odometry, GPS, the order of messages, and calibrations that are stated wrong.
#include <gtest/gtest.h>

#include "libvio/base/angles.h"
#include "libvio/simulation/scenario.h"

namespace vio {
namespace {

using Eigen::Vector3d;

// 100 m straight ahead in 400 s with a rest of 10 s in the middle.
SplineTrajectory straight() {
    ScenarioMotion motion;
    motion.path = "drive";
    motion.route = "0 0, 50 0, 100 0";
    motion.duration_s = 400;
    motion.stops = 1;
    motion.stop_duration_s = 10;
    return motion.make(3);
}

std::vector<double> every(double step, double end) {
    std::vector<double> times;
    for (int k = 0; k * step <= end; ++k) times.push_back(k * step);
    return times;
}

TEST(Drive, KeepsToTheGroundAndFacesItsWay) {
    ScenarioMotion motion;
    motion.path = "drive";
    motion.route = "0 0, 5 5, 10 0, 5 -5, 0 0";
    motion.duration_s = 60;
    motion.stops = 3;
    const SplineTrajectory trajectory = motion.make(1);
    double moving = 0;
    for (double t = 0; t <= 60; t += 0.1) {
        const Motion m = trajectory.at(t);
        EXPECT_NEAR(m.T_W_B.p.z(), 0, 1e-9);
        if (m.v_W.norm() < 0.2) continue;
        ++moving;
        EXPECT_GT(m.v_W.normalized().dot(m.T_W_B.R.col(0)), 0.999) << t;
    }
    EXPECT_GT(moving, 300);
    EXPECT_LT((trajectory.at(60).T_W_B.p).norm(), 1e-6) << "the route is closed";
}

TEST(Odometry, HasTheStatedErrorAfterADistance) {
    const SplineTrajectory trajectory = straight();
    OdometryModel model;
    model.yaw_noise_deg = 0;
    double along = 0, across = 0;
    constexpr int kRuns = 200;
    for (int seed = 0; seed < kRuns; ++seed) {
        Random random(static_cast<std::uint64_t>(seed), "odometry");
        const auto odometry = simulate_odometry(trajectory, every(1, 400), model, random);
        const Vector3d error = odometry.messages.back().T_O_B.p - odometry.truth.back().p;
        along += error.x() * error.x();
        across += error.y() * error.y();
    }
    // Random walk over 100 m, and along the way the error of the scale.
    const double walk = 0.005 * 0.005 * 100, scale = std::pow(0.003 * 100, 2);
    const double bound = 4 * std::sqrt(2.0 / kRuns);  // four sigma of a chi-square over its mean
    EXPECT_NEAR(along / kRuns / (walk + scale), 1, bound);
    EXPECT_NEAR(across / kRuns / walk, 1, bound);
}

TEST(Odometry, SlipsWhileTheVehicleRestsAndComesBack) {
    const SplineTrajectory trajectory = straight();
    OdometryModel model;
    model.scale_sigma = model.distance_noise = model.yaw_noise_deg = 0;
    model.slips = 1;
    Random random(1, "odometry");
    const auto times = every(0.1, 400);
    const auto odometry = simulate_odometry(trajectory, times, model, random);
    double largest = 0;
    for (size_t k = 0; k < times.size(); ++k) {
        const double error = (odometry.messages[k].T_O_B.p - odometry.truth[k].p).norm();
        if (odometry.slipping[k]) {
            EXPECT_LT(trajectory.at(times[k]).v_W.norm(), 1e-3);
        }
        largest = std::max(largest, error);
    }
    EXPECT_GT(largest, 0.6);
    EXPECT_LT(largest, 1.4);
    EXPECT_LT((odometry.messages.back().T_O_B.p - odometry.truth.back().p).norm(), 0.06 * largest);
}

TEST(Geodetic, GoesThereAndBack) {
    for (const Geodetic origin :
         {Geodetic{-20.9, -69.9, 1000}, Geodetic{89.99, 10, 0}, Geodetic{0, 179.999, -100}})
        for (const Vector3d& enu :
             {Vector3d(0, 0, 0), Vector3d(120, -300, 15), Vector3d(-40000, 60000, 2000)}) {
            const Geodetic place = geodetic_from_enu(enu, origin);
            EXPECT_LT((enu_from_geodetic(place, origin) - enu).norm(), 1e-6);
        }
    // One minute of arc along the meridian at 45 degrees is 1852.2 m on this ellipsoid.
    EXPECT_NEAR(enu_from_geodetic({45 + 1.0 / 120, 7, 0}, {45 - 1.0 / 120, 7, 0}).y(), 1852.2, 0.1);
}

TEST(Gps, FixesAreTruthPlusTheStatedErrorsAndJumpWithTheSatellites) {
    const SplineTrajectory trajectory = straight();
    GpsModel model;
    model.wander = 0;
    model.noise = 0.01;
    model.satellite_change_interval_s = 50;
    Random random(2, "gps");
    const auto times = every(1, 400);
    const SimulatedGps gps = simulate_gps(trajectory, times, model, random);
    int changes = 0;
    for (size_t k = 0; k < times.size(); ++k) {
        const GpsMessage& fix = gps.messages[k];
        const Vector3d enu =
            enu_from_geodetic({fix.latitude_deg, fix.longitude_deg, fix.altitude_m}, model.origin);
        EXPECT_LT((enu - trajectory.at(times[k]).T_W_B.p - gps.error_enu[k]).norm(), 1e-6);
        if (k == 0) continue;
        const double step = (gps.error_enu[k] - gps.error_enu[k - 1]).norm();
        changes += gps.satellites_changed[k] ? 1 : 0;
        if (gps.satellites_changed[k])
            EXPECT_GT(step, 0.15);
        else
            EXPECT_LT(step, 0.15);
    }
    EXPECT_GE(changes, 2);  // 8 expected
    EXPECT_LE(changes, 18);
}

TEST(Stream, DropsAndRepeatsTheStatedShares) {
    std::vector<StreamEntry> entries;
    constexpr int kReadings = 20000;
    for (int i = 0; i < kReadings; ++i) {
        entries.push_back({i * TimeNs{10}, StreamEntry::Kind::kImu, i});
        if (i % 10 == 0) entries.push_back({i * TimeNs{10}, StreamEntry::Kind::kImage, i / 10});
    }
    StreamModel model;
    Random random(4, "messages");
    EXPECT_EQ(arranged(entries, model, random).size(), entries.size());
    model.imu_drop_rate = 0.2;
    model.longest_drop = 5;
    model.duplicate_rate = 0.1;
    const auto stream = arranged(entries, model, random);
    int images = 0, readings = 0, repeated = 0;
    for (size_t k = 0; k < stream.size(); ++k) {
        if (k > 0) {
            EXPECT_GE(stream[k].t, stream[k - 1].t);
        }
        const bool again =
            k > 0 && stream[k].kind == stream[k - 1].kind && stream[k].index == stream[k - 1].index;
        repeated += again ? 1 : 0;
        if (again) continue;
        (stream[k].kind == StreamEntry::Kind::kImu ? readings : images) += 1;
    }
    EXPECT_EQ(images, kReadings / 10);
    EXPECT_NEAR(readings, 0.8 * kReadings, 0.02 * kReadings);
    EXPECT_NEAR(repeated, 0.1 * (readings + images), 0.01 * kReadings);
}

TEST(StatedCalibration, DeviatesAsAsked) {
    ScenarioOptions options;
    options.image_count = 2;
    options.imu_margin_s = 0;
    double focal = 0, turn = 0;
    constexpr int kRuns = 200;
    for (int seed = 0; seed < kRuns; ++seed) {
        options.seed = seed;
        options.calibration.intrinsics_sigma = "3.2";
        options.calibration.camera_rotation_deg = 1;
        options.calibration.time_offset_error = 0.01;
        const Simulation simulation(options);
        const Rig &truth = simulation.rig(), &stated = simulation.stated_rig();
        // A point near the axis: distortion is nothing there.
        const auto width = [&](const Rig& rig) {
            return (*rig.camera->project({1e-3, 0, 1}) - *rig.camera->project({0, 0, 1})).x();
        };
        focal += std::pow((width(stated) - width(truth)) / 1e-3 / 3.2, 2);
        turn += Eigen::AngleAxisd(truth.T_B_C.R.transpose() * stated.T_B_C.R).angle() *
                Eigen::AngleAxisd(truth.T_B_C.R.transpose() * stated.T_B_C.R).angle() /
                std::pow(kDegree, 2);
        EXPECT_EQ(truth.T_B_I.p, stated.T_B_I.p);
        EXPECT_DOUBLE_EQ(stated.time_offset - truth.time_offset, 0.01);
    }
    EXPECT_NEAR(focal / kRuns, 1, 4 * std::sqrt(2.0 / kRuns));
    EXPECT_NEAR(turn / kRuns, 3, 4 * std::sqrt(6.0 / kRuns));
}

}  // namespace
}  // namespace vio
