// The recursive estimator over a long time: memory, covariance, error.
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "libvio/geometry/alignment.h"
#include "tests/feed.h"
#include "tests/looped_simulation.h"

namespace vio {
namespace {

double resident_bytes() {
    std::ifstream statm("/proc/self/statm");
    long total = 0, resident = 0;
    statm >> total >> resident;
    return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

double least_scaled_eigenvalue(const Eigen::MatrixXd& P) {
    const Eigen::VectorXd scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd C = scale.asDiagonal() * P * scale.asDiagonal();
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(C, Eigen::EigenvaluesOnly)
        .eigenvalues()
        .minCoeff();
}

// Memory may depend on the size of the state and of a lap, not on how many laps there were; the
// covariance stays positive definite, and the error inside four sigma of it. The same over eight
// hours: vio_long_run, in tests/figures.sh.
TEST(LongRun, MemoryIsBoundedAndTheCovariancePositiveDefinite) {
    const ScenarioOptions scenario =
        ScenarioOptions::from_file(std::string(VIO_SOURCE_DIR) + "/datasets/stress/base.ini");
    test::LoopedSimulation simulation(scenario);
    IekfOptions options;
    options.sigma_px = scenario.track_model.noise_px;
    Iekf filter(simulation.rig(), options, {});
    std::optional<Similarity> alignment;
    double resident = 0;
    for (int i = 0; i < 5; ++i) {
        const auto lap = simulation.next();
        test::feed(filter, lap.readings, lap.frames);
        const Estimate piece = filter.take();
        ASSERT_GT(piece.states.size(), 300u);
        EXPECT_TRUE(filter.estimate().states.empty());
        const auto truth_at = [&](TimeNs t) {
            for (const StateEstimate& truth : lap.truth)
                if (truth.t == t) return truth.T_W_B;
            throw InputError("a state at no image's time");
        };
        if (!alignment)
            alignment =
                align_yaw_position(piece.states.front().T_W_B, truth_at(piece.states.front().t));
        const StateEstimate& last = piece.states.back();
        const Eigen::Vector3d error =
            alignment->R.transpose() * (truth_at(last.t).p - (*alignment * last.T_W_B).p);
        const Eigen::Matrix3d P = last.covariance.block<3, 3>(kPosition, kPosition);
        EXPECT_LT(error.dot(P.ldlt().solve(error)), 16) << "lap " << i << ": " << error.norm();
        EXPECT_GT(least_scaled_eigenvalue(filter.state()->covariance()), 0);
        if (i == 2) resident = resident_bytes();
        if (i > 2) {
            EXPECT_LT(resident_bytes(), 1.05 * resident);
        }
    }
}

}  // namespace
}  // namespace vio
