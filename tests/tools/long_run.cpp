// Runs the recursive estimator for hours over a scenario that is driven to and fro:
//   vio_long_run SCENARIO.ini HOURS [section.name=value...]
// and prints a row for each lap: simulated hours; resident memory; least eigenvalue of the whole
// covariance, scaled to unit diagonal; position error and its standard deviation after alignment of
// the first pose; position NEES; images lost; time of the filter.
#include <unistd.h>
#include <chrono>
#include <cstdio>
#include <fstream>

#include "libvio/geometry/alignment.h"
#include "tests/feed.h"
#include "tests/looped_simulation.h"

namespace {

double resident_mb() {
    std::ifstream statm("/proc/self/statm");
    long total = 0, resident = 0;
    statm >> total >> resident;
    return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

double least_eigenvalue(const Eigen::MatrixXd& P) {
    const Eigen::VectorXd scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd C = scale.asDiagonal() * P * scale.asDiagonal();
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(C, Eigen::EigenvaluesOnly)
        .eigenvalues()
        .minCoeff();
}

void run(int argc, char** argv) {
    if (argc < 3) throw vio::InputError("vio_long_run: SCENARIO.ini HOURS [ARGUMENT...]");
    vio::ScenarioOptions scenario = vio::ScenarioOptions::from_file(argv[1]);
    vio::IekfOptions iekf;
    vio::BatchOptions batch;
    iekf.sigma_px = batch.sigma_px = scenario.track_model.noise_px;
    vio::OptionSet scenario_set, estimator_set;
    scenario.describe(scenario_set);
    iekf.describe(estimator_set);
    batch.describe(estimator_set);
    for (int i = 3; i < argc; ++i) {
        const std::string a = argv[i];
        (a.rfind("iekf.", 0) == 0 || a.rfind("batch.", 0) == 0 ? estimator_set : scenario_set)
            .set(a);
    }
    vio::test::LoopedSimulation simulation(scenario);
    vio::Iekf filter(simulation.rig(), iekf, batch);
    const double hours = std::stod(argv[2]);
    std::optional<vio::Similarity> alignment;
    double simulated = 0, seconds = 0;
    std::size_t said = 0;
    std::printf("%7s %8s %10s %9s %8s %8s %7s %7s %9s\n", "hours", "RSS MB", "least eig", "error m",
                "sigma m", "NEES/3", "poses", "lost", "filter s");
    while (simulated < 3600 * hours) {
        const auto lap = simulation.next();
        simulated += simulation.period();
        const auto begin = std::chrono::steady_clock::now();
        vio::test::feed(filter, lap.readings, lap.frames, simulation.rig().time_offset);
        seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
        const vio::Estimate piece = filter.take();
        for (; said < filter.status().size(); ++said)
            std::printf("   %s\n", filter.status()[said].text.c_str());
        int lost = 0;
        for (const auto& state : piece.states) lost += state.lost;
        if (piece.states.empty()) continue;
        const vio::StateEstimate& last = piece.states.back();
        const auto truth_at = [&](vio::TimeNs t) {
            for (const auto& truth : lap.truth)
                if (truth.t == t) return truth.T_W_B;
            throw vio::InputError("a state at no image's time");
        };
        if (!alignment)
            alignment = vio::align_yaw_position(piece.states.front().T_W_B,
                                                truth_at(piece.states.front().t));
        const Eigen::Vector3d error =
            alignment->R.transpose() * (truth_at(last.t).p - (*alignment * last.T_W_B).p);
        const Eigen::Matrix3d P = last.covariance.block<3, 3>(vio::kPosition, vio::kPosition);
        std::printf("%7.3f %8.1f %10.2g %9.2f %8.2f %8.2f %7zu %7d %9.1f\n", simulated / 3600,
                    resident_mb(), least_eigenvalue(filter.state()->covariance()), error.norm(),
                    std::sqrt(P.trace()), error.dot(P.ldlt().solve(error)) / 3, piece.states.size(),
                    lost, seconds);
        std::fflush(stdout);
    }
    std::printf("%.0f x real time\n", simulated / seconds);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        run(argc, argv);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
