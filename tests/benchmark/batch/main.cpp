// The batch estimator's minimisation against Ceres: same residuals, same start, same cost.
//   vio_bench_batch [--scaling] [--ours] [--threads N] [--truth RECORDED_PATH] [SCENARIO.ini ...]
// --truth: for scenarios along a recorded path. Without scenarios: a room; without --threads:
// one and two. Each solver runs in a
// process of its own, so that its memory can be told: the most that it took above what the problem
// itself takes.
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <iostream>

#include "libvio/batch/minimize.h"
#include "tests/benchmark/batch/problems.h"
#include "tests/benchmark/batch/rival.h"

namespace vio::bench {
namespace {

Solved solve_with_ours(const TimedProblem& problem, int threads) {
    const auto began = std::chrono::steady_clock::now();
    batch::State state = problem.start;
    BatchOptions options = problem.options;
    options.threads = threads;
    batch::NormalEquations equations(problem.model, batch::make_layout(problem.model, options),
                                     threads);
    batch::Objective objective(problem.model, options, {});
    const double prepared =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    const auto report = batch::minimize(objective, equations, {200, 1e-9, 1e-8, 0}, state);
    Solved solved;
    solved.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    solved.iterations = report.iterations;
    solved.final_cost = report.final.total();
    for (size_t k = 0; k < std::min<size_t>(Solved::kSteps, report.progress.size()); ++k) {
        solved.step_seconds[k] = prepared + report.progress[k].seconds;
        solved.step_cost[k] = report.progress[k].cost;
    }
    solved.converged = report.converged;
    return solved;
}

// A field of /proc/self/status [MB].
double status_mb(const char* field) {
    std::ifstream file("/proc/self/status");
    std::string line;
    while (std::getline(file, line))
        if (line.rfind(field, 0) == 0) return std::stod(line.substr(std::strlen(field) + 1)) / 1024;
    return 0;
}

struct Measured {
    Solved solved;
    double peak_mb = 0, cpu_seconds = 0;
};

double cpu_seconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
        return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// Runs in a child process.
Measured measured(const std::function<Solved()>& solve) {
    int channel[2];
    if (pipe(channel) != 0) throw std::runtime_error("pipe");
    const pid_t child = fork();
    if (child == 0) {
        std::ofstream("/proc/self/clear_refs") << 5;  // forget the peak so far
        const double before = status_mb("VmRSS");
        const double cpu_before = cpu_seconds();
        Measured result{solve(), 0, 0};
        result.cpu_seconds = cpu_seconds() - cpu_before;
        result.peak_mb = status_mb("VmHWM") - before;
        const bool written = write(channel[1], &result, sizeof result) == sizeof result;
        _exit(written ? 0 : 1);
    }
    close(channel[1]);
    Measured result;
    const bool whole = read(channel[0], &result, sizeof result) == sizeof result;
    close(channel[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (!whole) throw std::runtime_error("a solver's process ended early");
    return result;
}

void print_row(const char* solver, int threads, const Measured& m) {
    std::printf("  %-8s %7d %10d %12.1f %9.2f %9.2f %9.0f %16.6f%s\n", solver, threads,
                m.solved.iterations, 1e3 * m.solved.seconds / std::max(1, m.solved.iterations),
                m.solved.seconds, m.cpu_seconds, m.peak_mb, m.solved.final_cost,
                m.solved.converged ? "" : "  not converged");
    std::fflush(stdout);
}

void print_header() {
    std::printf("  %-8s %7s %10s %12s %9s %9s %9s %16s\n", "solver", "threads", "iterations",
                "ms/iteration", "total s", "CPU s", "peak MB", "final cost");
}

void compare(const TimedProblem& problem, bool rival, const std::vector<int>& thread_counts) {
    std::printf("%s\n", described(problem).c_str());
    print_header();
    std::fflush(stdout);
    for (int threads : thread_counts) {
        const auto ours = measured([&] { return solve_with_ours(problem, threads); });
        print_row("ours", threads, ours);
        if (!rival) continue;
        const auto ceres = measured([&] {
            return solve_with_ceres(problem.model, problem.options, problem.start, threads);
        });
        print_row("Ceres", threads, ceres);
        std::printf("    %.1f times faster (CPU: %.1f), %.2f of its memory, cost differs by %.1e\n",
                    ceres.solved.seconds / ours.solved.seconds,
                    ceres.cpu_seconds / ours.cpu_seconds, ours.peak_mb / ceres.peak_mb,
                    ours.solved.final_cost / ceres.solved.final_cost - 1);
        const double least = std::min(ours.solved.final_cost, ceres.solved.final_cost);
        for (const double share : {1e-3, 1e-4, 1e-5}) {
            const double mine = ours.solved.seconds_to((1 + share) * least),
                         its = ceres.solved.seconds_to((1 + share) * least);
            std::printf("    to within %.0e of the least cost: %.2f s and %.2f s, %.1f times\n",
                        share, mine, its, its / mine);
        }
    }
}

// Time of an iteration over the number of images, and the exponent fitted to it.
void scaling() {
    std::printf("Growth with the number of images (100 features an image, tracks of at most 40)\n");
    print_header();
    double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (int frames : {50, 100, 200, 400, 800, 1500, 3000}) {
        const TimedProblem problem = room_problem(frames, 100, 40);
        const auto ours = measured([&] { return solve_with_ours(problem, 1); });
        print_row(std::to_string(frames).c_str(), 1, ours);
        const double x = std::log(frames),
                     y = std::log(ours.solved.seconds / ours.solved.iterations);
        n += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    std::printf("    time per iteration grows as images^%.2f\n",
                (n * sxy - sx * sy) / (n * sxx - sx * sx));
}

}  // namespace
}  // namespace vio::bench

int main(int argc, char** argv) {
    using namespace vio::bench;
    bool with_scaling = false, rival = true;
    std::string truth;
    std::vector<std::string> scenarios;
    std::vector<int> threads{1, 2};
    for (int k = 1; k < argc; ++k) {
        const std::string argument = argv[k];
        if (argument == "--scaling")
            with_scaling = true;
        else if (argument == "--ours")
            rival = false;
        else if (argument == "--truth" && k + 1 < argc)
            truth = argv[++k];
        else if (argument == "--threads" && k + 1 < argc)
            threads = {std::stoi(argv[++k])};
        else
            scenarios.push_back(argument);
    }
    try {
        if (with_scaling) scaling();
        for (const std::string& scenario : scenarios)
            compare(scenario_problem(scenario, truth), rival, threads);
        if (scenarios.empty() && !with_scaling) compare(room_problem(700, 200, 60), rival, threads);
    } catch (const std::exception& error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
}
