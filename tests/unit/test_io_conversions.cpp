// Conversions to MRPT's types: poses with covariance, and the module for MRPT's programs.
#include <gtest/gtest.h>

#include <cstdlib>

#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"
#include "tests/unit/numeric_jacobian.h"
#include "tests/unit/scratch_folder.h"

namespace vio {
namespace {

// (x, y, z, yaw, pitch, roll) as MRPT has them.
Vector6d coordinates(const Pose& T) {
    const auto pose = to_mrpt(T);
    Vector6d c;
    c << pose.x(), pose.y(), pose.z(), pose.yaw(), pose.pitch(), pose.roll();
    return c;
}

std::vector<Pose> test_poses() {
    return {{so3::exp({0.3, -0.8, 1.2}), {1, -2, 3}},
            {so3::exp({2.9, 0.4, -0.3}), {0, 0, 0}},
            {so3::exp({0, 0, 0}), {1e3, 0, 1}},
            {so3::exp({0, 1.5, 0}) * so3::exp({0.2, 0, 0}), {0, 1, 0}}};
}

TEST(MrptPose, TangentJacobianAgreesWithDifferences) {
    for (const Pose& T : test_poses()) {
        const Matrix6d numeric = test::numeric_jacobian<6, 6>(
            [&](const Vector6d& d) { return coordinates(T.boxplus(d)); }, 1e-6);
        const Matrix6d analytic = mrpt_tangent_jacobian(T);
        EXPECT_LT((analytic - numeric).norm(), 1e-6 * analytic.norm());
    }
}

TEST(MrptPose, CovarianceSurvivesTheRoundTrip) {
    Matrix6d A;
    for (int i = 0; i < 36; ++i) A(i) = std::sin(1.0 + i * i);
    const Matrix6d covariance = A * A.transpose();
    for (const Pose& T : test_poses()) {
        const auto back = from_mrpt(to_mrpt(T, covariance));
        EXPECT_LT((back.covariance - covariance).norm(), 1e-10 * covariance.norm());
        EXPECT_LT(back.pose.boxminus(T).norm(), 1e-13);
    }
}

// A rotation about B's z axis alone is a yaw alone while the vehicle is level; position first.
TEST(MrptPose, OrderIsPositionYawPitchRoll) {
    Matrix6d covariance = Matrix6d::Zero();
    covariance(2, 2) = 4;  // rotation about z
    covariance(3, 3) = 9;  // x
    const auto pdf = to_mrpt(Pose{}, covariance);
    EXPECT_DOUBLE_EQ(pdf.cov(0, 0), 9);
    EXPECT_DOUBLE_EQ(pdf.cov(3, 3), 4);
    EXPECT_DOUBLE_EQ(pdf.cov.asEigen().sum(), 13);
}

TEST(MrptPose, StaysFiniteAtGimbalLock) {
    const Pose T{so3::exp({0, M_PI / 2, 0}), {0, 0, 0}};
    EXPECT_TRUE(mrpt_tangent_jacobian(T).allFinite());
}

// MRPT's own program reads our observation once it has loaded the module.
TEST(MrptModule, LetsRawlogEditReadFeatures) {
    if (std::system("command -v rawlog-edit >/dev/null") != 0)
        GTEST_SKIP() << "rawlog-edit (Debian package mrpt-apps) is absent";
#ifdef VIO_SANITIZE
    GTEST_SKIP() << "a program without the sanitizers cannot load a module with them";
#endif
    test::ScratchFolder folder;
    RawlogWriter writer(folder / "a.rawlog", Rig{});
    for (TimeNs t = 0; t < 3; ++t) {
        FeatureObservation feature;
        feature.feature_id = 5;
        writer.write(FeatureFrame{t * 1000000, {feature}});
    }
    writer.finish();
    const std::string command = std::string("rawlog-edit -p ") + VIO_MRPT_PLUGIN + " --info -i " +
                                (folder / "a.rawlog") + " > " + (folder / "out.txt") + " 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << read_text(folder / "out.txt");
    EXPECT_NE(read_text(folder / "out.txt").find("number of objects         : 3"),
              std::string::npos)
        << read_text(folder / "out.txt");
}

}  // namespace
}  // namespace vio
