// The program's figures against evo's published formulae, computed here from the files again, by
// other means than the library's: Umeyama's equations (1991, Eqs. 34-43) written out, homogeneous
// matrices, angles from quaternions, pairs found by exhaustive search.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>
#include <sstream>

#include "libvio/base/angles.h"
#include "libvio/io/trajectory_io.h"
#include "tests/cli/program.h"
#include "tests/data/recorded_data.h"
#include "tests/unit/scratch_folder.h"

namespace vio::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kTolerance = 1e-9;  // [m], [rad]

struct Row {
    long long t = 0;  // [ns]
    Vector3d p;
    Quaterniond q;
};

// `seconds.nanoseconds x y z qx qy qz qw`
std::vector<Row> read_tum(const std::string& file) {
    std::vector<Row> rows;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        if (line.empty() || line[0] == '#') continue;
        const size_t dot = line.find('.'), end = line.find(' ');
        std::string fraction = line.substr(dot + 1, end - dot - 1);
        fraction.resize(9, '0');
        Row row;
        row.t = std::stoll(line.substr(0, dot)) * 1'000'000'000 + std::stoll(fraction);
        std::istringstream numbers(line.substr(end));
        double x = 0, y = 0, z = 0, w = 0;
        numbers >> row.p.x() >> row.p.y() >> row.p.z() >> x >> y >> z >> w;
        row.q = Quaterniond(w, x, y, z).normalized();
        rows.push_back(row);
    }
    return rows;
}

Matrix4d matrix(const Vector3d& p, const Quaterniond& q) {
    Matrix4d T = Matrix4d::Identity();
    T.topLeftCorner<3, 3>() = q.toRotationMatrix();
    T.topRightCorner<3, 1>() = p;
    return T;
}

struct Pairs {
    std::vector<Matrix4d> P, Q;  // estimate, truth
    std::vector<double> seconds;
};

// The truth at the estimate's time, linear in position, along the great circle in attitude.
Pairs paired(const std::vector<Row>& estimate, const std::vector<Row>& truth) {
    Pairs pairs;
    for (const Row& e : estimate)
        for (size_t k = 0; k + 1 < truth.size(); ++k) {
            const Row &a = truth[k], &b = truth[k + 1];
            if (e.t < a.t || e.t > b.t || (e.t == b.t && k + 2 < truth.size())) continue;
            const double u = double(e.t - a.t) / double(b.t - a.t);
            pairs.P.push_back(matrix(e.p, e.q));
            pairs.Q.push_back(matrix(a.p + u * (b.p - a.p), a.q.slerp(u, b.q)));
            pairs.seconds.push_back(1e-9 * double(e.t - estimate.front().t));
            break;
        }
    return pairs;
}

// Umeyama, Eqs. (34)-(43): y = c R x + t in the sense of least squares.
void umeyama_alignment(Pairs& pairs, bool with_scale) {
    const double n = double(pairs.P.size());
    Vector3d mean_x = Vector3d::Zero(), mean_y = Vector3d::Zero();
    for (size_t i = 0; i < pairs.P.size(); ++i) {
        mean_x += pairs.P[i].topRightCorner<3, 1>() / n;
        mean_y += pairs.Q[i].topRightCorner<3, 1>() / n;
    }
    double variance_x = 0;
    Matrix3d covariance = Matrix3d::Zero();
    for (size_t i = 0; i < pairs.P.size(); ++i) {
        const Vector3d x = pairs.P[i].topRightCorner<3, 1>() - mean_x;
        const Vector3d y = pairs.Q[i].topRightCorner<3, 1>() - mean_y;
        variance_x += x.squaredNorm() / n;
        covariance += y * x.transpose() / n;
    }
    const Eigen::JacobiSVD<Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Vector3d S = Vector3d::Ones();
    if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) S.z() = -1;
    const Matrix3d R = svd.matrixU() * S.asDiagonal() * svd.matrixV().transpose();
    const double c = with_scale ? svd.singularValues().dot(S) / variance_x : 1;
    Matrix4d T = Matrix4d::Identity();
    T.topLeftCorner<3, 3>() = R;
    T.topRightCorner<3, 1>() = mean_y - c * R * mean_x;
    for (Matrix4d& P : pairs.P) {
        P.topRightCorner<3, 1>() *= c;
        P = (T * P).eval();
    }
}

double angle(const Matrix4d& E) {
    const Quaterniond q(Matrix3d(E.topLeftCorner<3, 3>()));
    return 2 * std::atan2(q.vec().norm(), std::abs(q.w()));
}

void expect_statistics(const nlohmann::json& ours, std::vector<double> errors, double unit,
                       const std::string& what) {
    ASSERT_EQ(ours["count"].get<size_t>(), errors.size()) << what;
    std::sort(errors.begin(), errors.end());
    const size_t n = errors.size();
    const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / double(n);
    double squares = 0, deviations = 0;
    for (const double e : errors) {
        squares += e * e / double(n);
        deviations += (e - mean) * (e - mean) / double(n);
    }
    const double median = 0.5 * (errors[(n - 1) / 2] + errors[n / 2]);
    const auto near = [&](const char* name, double value) {
        EXPECT_NEAR(unit * ours[name].get<double>(), value, kTolerance) << what << " " << name;
    };
    near("mean", mean);
    near("rmse", std::sqrt(squares));
    near("median", median);
    near("std", std::sqrt(deviations));
    near("min", errors.front());
    near("max", errors.back());
}

// For each pose the later one whose abscissa is nearest to `step` on, within a tenth of it; evo's
// all pairs, chosen along the reference.
void expect_steps(const nlohmann::json& ours, const Pairs& pairs, const std::vector<double>& x,
                  double step, const std::string& what) {
    std::vector<double> translation, rotation;
    for (size_t i = 0; i + 1 < x.size(); ++i) {
        size_t best = i + 1;
        for (size_t j = i + 2; j < x.size(); ++j)
            if (std::abs(x[j] - x[i] - step) < std::abs(x[best] - x[i] - step)) best = j;
        if (std::abs(x[best] - x[i] - step) > 0.1 * step) continue;
        const Matrix4d E = (pairs.Q[i].inverse() * pairs.Q[best]).inverse() *
                           (pairs.P[i].inverse() * pairs.P[best]);
        translation.push_back(E.topRightCorner<3, 1>().norm());
        rotation.push_back(angle(E));
    }
    ASSERT_GT(translation.size(), 50u) << what;
    expect_statistics(ours["translation_m"], translation, 1, what + " translation");
    expect_statistics(ours["rotation_deg"], rotation, kDegree, what + " rotation");
}

void expect_evo(const ScratchFolder& folder, const std::string& estimate,
                const std::string& truth_tum, const std::string& truth, double distance) {
    const Pairs unaligned = paired(read_tum(estimate), read_tum(truth_tum));
    for (const std::string align : {"none", "se3", "sim3"}) {
        Pairs pairs = unaligned;
        if (align != "none") umeyama_alignment(pairs, align == "sim3");
        std::vector<double> ape, angles, path(1, 0.0);
        for (size_t i = 0; i < pairs.P.size(); ++i) {
            const Matrix4d E = pairs.Q[i].inverse() * pairs.P[i];
            ape.push_back(E.topRightCorner<3, 1>().norm());
            angles.push_back(angle(E));
            if (i > 0)
                path.push_back(path.back() +
                               (pairs.Q[i] - pairs.Q[i - 1]).topRightCorner<3, 1>().norm());
        }
        const ProgramResult run =
            vio_slam("evaluate " + estimate + " --against " + truth + " --align " + align +
                         " --json --rpe-time 1" + " --rpe-distance " + std::to_string(distance),
                     folder.path().string());
        ASSERT_EQ(run.exit_code, 0) << run.err;
        const nlohmann::json ours = nlohmann::json::parse(run.out);
        expect_statistics(ours["position_m"], ape, 1, align + " APE");
        expect_statistics(ours["rotation_deg"], angles, kDegree, align + " APE angle");
        expect_steps(ours["relative_over_distance"][0], pairs, path, distance,
                     align + " RPE over distance");
        expect_steps(ours["relative_over_time"][0], pairs, pairs.seconds, 1,
                     align + " RPE over time");
    }
}

// The path as an estimator might see it: drifting, noisy, 3 % too large, in a world of its own.
std::vector<TimedPose> disturbed(const std::vector<TimedPose>& truth, size_t step) {
    std::mt19937 engine(7);
    std::normal_distribution<double> normal;
    const auto noise = [&](double sigma) {
        return Vector6d(sigma * Vector6d::NullaryExpr([&] { return normal(engine); }));
    };
    const Pose world{so3::exp({0.3, -0.8, 2.5}), {4, -7, 1}};
    std::vector<TimedPose> estimate;
    Vector6d drift = Vector6d::Zero();
    for (size_t i = 0; i < truth.size(); i += step) {
        drift += noise(5e-4);
        Pose T = truth[i].T_W_B.boxplus(drift + noise(2e-3));
        T.p *= 1.03;
        estimate.push_back({truth[i].t, world * T});
    }
    return estimate;
}

class EvoFormulae : public ::testing::Test {
 protected:
    void run(const std::string& arguments) {
        const ProgramResult result = vio_slam(arguments, folder_.path().string());
        ASSERT_EQ(result.exit_code, 0) << result.err;
    }

    ScratchFolder folder_;
};

TEST_F(EvoFormulae, HoldForAnEstimateOfMh01) {
    const auto data = recorded_data("euroc_mh01_15s");
    VIO_NEED_DATA(data);
    run("import asl " + data.string() + " -o " + folder_ / "mh01.rawlog");
    const std::string truth = folder_ / "mh01.truth.tum";
    run("run " + folder_ / "mh01.rawlog" + " --to 9 -o " + folder_ / "out");
    expect_evo(folder_, folder_ / "out/trajectory.tum", truth, truth, 0.5);
}

TEST_F(EvoFormulae, HoldAlongTheWholeFlightOfV101) {
    const auto data = recorded_data("euroc_v101_imu_gt");
    VIO_NEED_DATA(data);
    const std::string recorded = (data / "groundtruth.csv").string();
    const auto truth = read_trajectory(recorded);
    write_tum(folder_ / "truth.tum", truth, "T_W_B");
    write_tum(folder_ / "estimate.tum", disturbed(truth, 1), "T_W_B");
    expect_evo(folder_, folder_ / "estimate.tum", folder_ / "truth.tum", recorded, 5);
}

}  // namespace
}  // namespace vio::test
