// Runs the recursive estimator over seeds of a scenario and compares it with truth and batch:
//   vio_filter_runs compare SCENARIO.ini [SEEDS] [ARGUMENT...]
//   vio_filter_runs causal SCENARIO.ini [SEEDS] [ARGUMENT...]
//   vio_filter_runs consistency SCENARIO.ini [SEEDS] [ARGUMENT...]
//   vio_filter_runs faults SCENARIO.ini [SEEDS] [ARGUMENT...]
//   vio_filter_runs honesty SCENARIO.ini... [SEEDS] [ARGUMENT...]
// ARGUMENT: section.name=value of the scenario, of [iekf], [batch] or [told] (noise densities that
// the estimators believe in); --no-batch leaves the batch estimate out of compare. Errors are after
// alignment by position and yaw. The paper's tables: vio-slam reproduce.
#include <algorithm>
#include <cstdio>

#include "libvio/base/angles.h"
#include "libvio/base/chi_square.h"
#include "libvio/evaluation/evaluate.h"
#include "libvio/io/trajectory_io.h"
#include "tests/tools/filter_setup.h"

namespace {

using vio::Estimate;
using vio::Matrix6d;
using vio::Vector6d;
using vio::test::Filtered;
using vio::test::filtered;
using vio::test::rig;
using vio::test::scenario;
using vio::test::Setup;
using vio::test::setup;
using vio::test::setups;

double root(double mean_square) {
    return std::sqrt(mean_square);
}

// Of the first images; -1: of all.
vio::BatchResult batch(const vio::Simulation& sim, const Setup& s, int images = -1) {
    vio::BatchProblem problem;
    problem.rig = rig(sim, s);
    problem.frames = sim.tracks().frames;
    if (images >= 0) problem.frames.resize(static_cast<std::size_t>(images));
    problem.imu = vio::ImuSequence(sim.imu());
    return vio::estimate_batch(problem, s.batch);
}

vio::Evaluation judged(const vio::Simulation& sim, const Estimate& estimate) {
    Estimate truth;
    truth.states = sim.truth();
    vio::EvaluationOptions options;
    options.alignment = vio::AlignmentKind::kYawPosition;
    return vio::evaluate(trajectory(estimate), trajectory(truth), options);
}

void print_row(int seed, const char* name, const vio::Simulation& sim, const Estimate& estimate,
               double seconds, double* sum2) {
    const vio::Evaluation e = judged(sim, estimate);
    int lost = 0;
    for (const vio::StateEstimate& state : estimate.states) lost += state.lost;
    std::printf("%4d %-6s %9.2f %9.2f %9.2f %9.2f %7.0f %7d %8.2f\n", seed, name,
                100 * e.position.rmse, 100 * e.position.max, e.rotation.rmse / vio::kDegree,
                100 * e.scale_error.value_or(0),
                100.0 * static_cast<double>(estimate.states.size()) /
                    static_cast<double>(sim.truth().size()),
                lost, seconds);
    *sum2 += e.position.rmse * e.position.rmse;
    std::fflush(stdout);
}

void compare(const Setup& s) {
    std::printf("%4s %-6s %9s %9s %9s %9s %7s %7s %8s\n", "seed", "", "RMSE cm", "max cm",
                "rot deg", "scale %", "poses %", "lost", "s");
    double batch2 = 0, iekf2 = 0;
    for (int seed = 0; seed < s.seeds; ++seed) {
        const vio::Simulation sim(scenario(s, seed));
        if (s.with_batch) {
            const vio::BatchResult result = batch(sim, s);
            print_row(seed, "batch", sim, result.estimate, result.report.seconds, &batch2);
        }
        const Filtered f = filtered(sim, s);
        for (const vio::StatusEntry& entry : f.status)
            std::printf("%4d        %.2f s: %s\n", seed, sim.seconds(entry.t), entry.text.c_str());
        if (f.estimate.states.empty())
            std::printf("%4d no pose\n", seed);
        else
            print_row(seed, "iekf", sim, f.estimate, f.seconds, &iekf2);
    }
    std::printf("root mean square of %d seeds: iekf %.2f cm", s.seeds, 100 * root(iekf2 / s.seeds));
    if (s.with_batch)
        std::printf(", batch %.2f cm, ratio %.2f", 100 * root(batch2 / s.seeds),
                    std::sqrt(iekf2 / batch2));
    std::printf("\n");
}

// Images that the filter's start took: those before the first that it took up itself.
int started_from(const Estimate& estimate) {
    if (estimate.innovations.empty()) return static_cast<int>(estimate.states.size());
    const auto first = std::find_if(
        estimate.states.begin(), estimate.states.end(),
        [&](const vio::StateEstimate& s) { return s.t >= estimate.innovations.front().t; });
    return static_cast<int>(first - estimate.states.begin());
}

// Squared error of the last pose's position, the worlds brought together where both begin [m^2].
double last_error2(const vio::Simulation& sim, const Estimate& estimate) {
    const vio::Similarity S =
        align_yaw_position(estimate.states.front().T_W_B, sim.truth().front().T_W_B);
    return ((S * estimate.states.back().T_W_B).p - sim.truth().back().T_W_B.p).squaredNorm();
}

// What a causal estimator can reach: the last pose of the batch estimate of all images up to each,
// every eighth after the filter's start and the last of all. The start's states are the filter's,
// too. Beside it the filter and the batch estimate of all images, which knows the future, at the
// same images; and in the end, where all three know the same, their last poses.
void causal(const Setup& s) {
    constexpr int kStep = 8;
    const char* names[] = {"batch", "causal", "iekf"};
    double all2[3] = {}, last2[3] = {};
    std::printf("%4s %-6s %9s %9s %9s %9s %7s %7s %8s\n", "seed", "", "RMSE cm", "max cm",
                "rot deg", "scale %", "poses %", "lost", "s");
    for (int seed = 0; seed < s.seeds; ++seed) {
        const vio::Simulation sim(scenario(s, seed));
        const Filtered f = filtered(sim, s);
        const int images = static_cast<int>(sim.truth().size());
        const int start = started_from(f.estimate);
        Estimate best;
        double seconds = 0;
        for (int n = start; n < images + kStep; n += kStep) {
            const vio::BatchResult result = batch(sim, s, std::min(n, images));
            const auto& states = result.estimate.states;
            if (n == start)
                best.states = states;
            else
                best.states.push_back(states.back());
            seconds += result.report.seconds;
        }
        const auto at_same_images = [&](const Estimate& estimate) {
            Estimate thinned;
            for (const vio::StateEstimate& state : estimate.states)
                for (const vio::StateEstimate& b : best.states)
                    if (b.t == state.t) thinned.states.push_back(state);
            return thinned;
        };
        const vio::BatchResult all = batch(sim, s);
        const Estimate judged_at[] = {at_same_images(all.estimate), best,
                                      at_same_images(f.estimate)};
        const double took[] = {all.report.seconds, seconds, f.seconds};
        std::printf("%4d started from %d images\n", seed, start);
        for (int k = 0; k < 3; ++k) {
            print_row(seed, names[k], sim, judged_at[k], took[k], &all2[k]);
            last2[k] += last_error2(sim, judged_at[k]);
        }
    }
    const auto cm = [&](double sum2) { return 100 * root(sum2 / s.seeds); };
    std::printf(
        "root mean square: batch %.2f cm, causal optimum %.2f cm, iekf %.2f cm, ratio %.2f\n",
        cm(all2[0]), cm(all2[1]), cm(all2[2]), std::sqrt(all2[2] / all2[1]));
    std::printf("of the last pose: batch %.2f cm, iekf %.2f cm, ratio %.2f\n", cm(last2[0]),
                cm(last2[2]), std::sqrt(last2[2] / last2[0]));
}

// Pose NEES by image, mean over seeds, position and rotation apart. The estimate's world is tied to
// its first pose, so the two worlds are brought together there. The estimators believe what the
// truth is drawn from: biases as the scenario has them, the camera's mount exact.
void consistency(Setup s) {
    constexpr double kLeast = 1e-6;  // of the options
    s.batch.gyro_bias_sigma = std::max(kLeast, s.scenario.gyro_bias_sigma);
    s.batch.accel_bias_sigma = std::max(kLeast, s.scenario.accel_bias_sigma);
    s.iekf.camera_rotation_sigma = s.iekf.camera_position_sigma = s.iekf.time_offset_sigma = 0;
    struct Sum {
        double position = 0, rotation = 0, pose = 0;
        int count = 0;
    };
    std::vector<Sum> by_image;
    double squared_error = 0;
    int poses = 0, started = 0;
    for (int seed = 0; seed < s.seeds; ++seed) {
        const vio::Simulation sim(scenario(s, seed));
        const Estimate estimate = filtered(sim, s).estimate;
        if (estimate.states.empty()) continue;
        ++started;
        by_image.resize(std::max(by_image.size(), sim.truth().size()));
        std::size_t i = 0;
        while (sim.truth()[i].t != estimate.states.front().t) ++i;
        const vio::Similarity S =
            align_yaw_position(estimate.states.front().T_W_B, sim.truth()[i].T_W_B);
        for (const vio::StateEstimate& state : estimate.states) {
            while (sim.truth()[i].t < state.t) ++i;
            const vio::Pose aligned = S * state.T_W_B;
            Matrix6d C = state.covariance.topLeftCorner<6, 6>();
            Matrix6d turn = Matrix6d::Identity();
            turn.bottomRightCorner<3, 3>() = S.R;
            C = (turn * C * turn.transpose()).eval();
            const Vector6d d = sim.truth()[i].T_W_B.boxminus(aligned);
            squared_error += d.tail<3>().squaredNorm();
            ++poses;
            if (C.diagonal().minCoeff() <= 1e-16) continue;  // where the world begins
            Sum& sum = by_image[i];
            sum.position += d.tail<3>().dot(C.bottomRightCorner<3, 3>().ldlt().solve(d.tail<3>()));
            sum.rotation += d.head<3>().dot(C.topLeftCorner<3, 3>().ldlt().solve(d.head<3>()));
            sum.pose += d.dot(C.ldlt().solve(d));
            ++sum.count;
        }
    }
    // Two-sided 95 % of the mean of n chi-square variables.
    const auto bounds = [](int dof, int n) {
        const double low = vio::chi_square_quantile(dof * n, 0.025) / n;
        return std::pair(low, vio::chi_square_quantile(dof * n, 0.975) / n);
    };
    if (started == 0) throw vio::InputError("no seed gave a pose");
    const auto [low3, high3] = bounds(3, started);
    const auto [low6, high6] = bounds(6, started);
    std::printf(
        "bounds of the mean over %d seeds (%d without a pose): %.2f-%.2f (3 dof), "
        "%.2f-%.2f (6 dof)\n",
        started, s.seeds - started, low3, high3, low6, high6);
    std::printf("%7s %9s %9s %9s\n", "image", "position", "rotation", "pose");
    int inside[3] = {}, below[3] = {}, images = 0;
    Sum total;
    const std::size_t step = std::max<std::size_t>(1, by_image.size() / 20);
    for (std::size_t i = 0; i < by_image.size(); ++i) {
        Sum& sum = by_image[i];
        if (sum.count < started) continue;
        const double mean[3] = {sum.position / sum.count, sum.rotation / sum.count,
                                sum.pose / sum.count};
        total.position += mean[0], total.rotation += mean[1], total.pose += mean[2];
        for (int k = 0; k < 3; ++k) {
            inside[k] += mean[k] >= (k < 2 ? low3 : low6) && mean[k] <= (k < 2 ? high3 : high6);
            below[k] += mean[k] <= (k < 2 ? high3 : high6);
        }
        ++images;
        if (i % step == 0 || i + 1 == by_image.size())
            std::printf("%7zu %9.2f %9.2f %9.2f\n", i, mean[0], mean[1], mean[2]);
    }
    std::printf("mean    %9.2f %9.2f %9.2f\n", total.position / images, total.rotation / images,
                total.pose / images);
    std::printf("inside  %8.1f%% %8.1f%% %8.1f%%\n", 100.0 * inside[0] / images,
                100.0 * inside[1] / images, 100.0 * inside[2] / images);
    std::printf("below   %8.1f%% %8.1f%% %8.1f%%\n", 100.0 * below[0] / images,
                100.0 * below[1] / images, 100.0 * below[2] / images);
    std::printf("position RMSE %.2f cm\n", 100 * root(squared_error / poses));
}

// How far an estimate may be believed: images with a pose, and of these marked lost; where not
// lost, position RMSE and the worst errors in standard deviations (root of the Mahalanobis
// distance); error in the end. Errors after alignment of the first pose by yaw and position; worst
// over seeds. Of all seeds: mean NEES of position and rotation, and the share of them beyond four
// standard deviations, which is 0.11 % where errors are as stated.
struct Honesty {
    static constexpr double kFar = 4;  // standard deviations
    struct Normalised {
        double worst = 0, sum2 = 0;
        int count = 0, far = 0;

        void add(double distance2) {
            worst = std::max(worst, root(distance2));
            sum2 += distance2;
            ++count;
            far += distance2 > kFar * kFar;
        }
        double mean() const { return sum2 / std::max(1, count); }
    };
    int poses = 0, lost = 0, end_lost = 0;
    double rmse = 0, end = 0;
    Normalised position, rotation;

    void add(const vio::Simulation& sim, const Estimate& estimate);
    void print(const char* name) const {
        std::printf(
            "%-20s %6d %6d %9.2f %9.2f %9.2f %8.2f %9d %8.2f %8.2f %8.2f\n", name, poses, lost,
            100 * rmse, position.worst, rotation.worst, 100 * end, end_lost, position.mean(),
            rotation.mean(),
            100.0 * (position.far + rotation.far) / std::max(1, position.count + rotation.count));
        std::fflush(stdout);
    }
    static void print_header(const char* name) {
        std::printf("%-20s %6s %6s %9s %9s %9s %8s %9s %8s %8s %8s\n", name, "poses", "lost",
                    "RMSE cm", "pos sigma", "rot sigma", "end cm", "end lost", "pos NEES",
                    "rot NEES", "far %");
    }
};

void Honesty::add(const vio::Simulation& sim, const Estimate& estimate) {
    if (estimate.states.empty()) return;
    std::size_t i = 0;
    while (sim.truth()[i].t != estimate.states.front().t) ++i;
    const vio::Similarity S =
        align_yaw_position(estimate.states.front().T_W_B, sim.truth()[i].T_W_B);
    double sum2 = 0;
    int good = 0;
    for (const vio::StateEstimate& state : estimate.states) {
        while (sim.truth()[i].t < state.t) ++i;
        const vio::Pose truth = S.inverse() * sim.truth()[i].T_W_B;
        const Vector6d e = truth.boxminus(state.T_W_B);
        const auto take = [&](int at, Normalised& of) {
            const Eigen::Matrix3d C = state.covariance.block<3, 3>(at, at);
            const Eigen::Vector3d d = e.segment<3>(at);
            if (C.diagonal().minCoeff() > 1e-10) of.add(d.dot(C.ldlt().solve(d)));
        };
        end = std::max(end, state.t == estimate.states.back().t ? e.tail<3>().norm() : 0.0);
        lost += state.lost;
        ++poses;
        take(vio::kRotation, rotation);
        if (state.lost) continue;
        sum2 += e.tail<3>().squaredNorm();
        ++good;
        take(vio::kPosition, position);
    }
    rmse = std::max(rmse, root(sum2 / std::max(1, good)));
    end_lost += estimate.states.back().lost;
}

// What the filter said from a time [s] on.
void print_said(const vio::Simulation& sim, const Filtered& f, double from) {
    for (const vio::StatusEntry& entry : f.status)
        if (sim.seconds(entry.t) > from)
            std::printf("        %.2f s: %s\n", sim.seconds(entry.t), entry.text.c_str());
}

// A row for each interruption of the messages, and what the filter said of it (first seed).
void faults(const Setup& s) {
    constexpr double kFrom = 6;  // [s]
    struct Row {
        const char* key;
        double seconds;
    };
    const Row rows[] = {{"dark", 0},          {"dark", 2},        {"dark", 5},
                        {"dark", 10},         {"no_images", 0.5}, {"no_images", 2},
                        {"no_images", 5},     {"no_images", 10},  {"no_readings", 0.1},
                        {"no_readings", 0.5}, {"no_readings", 1}, {"no_readings", 2},
                        {"no_readings", 5}};
    Honesty::print_header("missing from 6 s on");
    for (const Row& row : rows) {
        Honesty honesty;
        for (int seed = 0; seed < s.seeds; ++seed) {
            vio::ScenarioOptions options = scenario(s, seed);
            vio::OptionSet set;
            options.describe(set);
            set.set("messages." + std::string(row.key) + "=" + std::to_string(row.seconds));
            set.set("messages." + std::string(row.key) + "_from=" + std::to_string(kFrom));
            const vio::Simulation sim(options);
            const Filtered f = filtered(sim, s);
            honesty.add(sim, f.estimate);
            if (seed == 0) print_said(sim, f, kFrom);
        }
        char name[40];
        std::snprintf(name, sizeof name, "%s %.1f s", row.key, row.seconds);
        honesty.print(name);
    }
}

// A row for each scenario, and what the filter said (first seed).
void honesty(const std::vector<Setup>& setups) {
    Honesty::print_header("");
    for (const Setup& s : setups) {
        Honesty honesty;
        for (int seed = 0; seed < s.seeds; ++seed) {
            const vio::Simulation sim(scenario(s, seed));
            const Filtered f = filtered(sim, s);
            honesty.add(sim, f.estimate);
            if (seed == 0) print_said(sim, f, -1);
        }
        honesty.print(s.scenario.name.c_str());
    }
}

}  // namespace

int main(int argc, char** argv) {
    try {
        const Setup s = setup(argc, argv);
        const std::string command = argv[1];
        if (command == "compare")
            compare(s);
        else if (command == "causal")
            causal(s);
        else if (command == "consistency")
            consistency(s);
        else if (command == "faults")
            faults(s);
        else if (command == "honesty")
            honesty(setups(argc, argv));
        else
            throw vio::InputError(command + ": no such command");
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
