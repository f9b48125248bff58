#include "tests/benchmark/batch/rival.h"

#include <ceres/ceres.h>
#include <omp.h>

#include <chrono>
#include <deque>

#include "libvio/geometry/so3.h"
#include "libvio/imu/preintegration.h"

extern "C" {
[[gnu::weak]] void openblas_set_num_threads(int threads);
}

namespace vio::bench {
namespace {

// Derivatives as Ceres stores them.
template <int rows, int cols>
using RowMajor = Eigen::Map<Eigen::Matrix<double, rows, cols, Eigen::RowMajor>>;

Eigen::Matrix<double, 3, 2> tangent_basis(const Eigen::Vector3d& direction) {
    const Eigen::Vector3d a = direction.unitOrthogonal();
    Eigen::Matrix<double, 3, 2> basis;
    basis << a, direction.normalized().cross(a);
    return basis;
}

// (quaternion x y z w, position). Cost functions give derivatives wrt the 6 tangent directions in
// their first six columns, so that the product with PlusJacobian costs nothing in accuracy.
class PoseManifold final : public ceres::Manifold {
 public:
    int AmbientSize() const override { return 7; }
    int TangentSize() const override { return 6; }
    bool Plus(const double* x, const double* d, double* sum) const override {
        const Eigen::Map<const Eigen::Quaterniond> q(x);
        const Eigen::Quaterniond dq(so3::exp(Eigen::Map<const Eigen::Vector3d>(d)));
        Eigen::Map<Eigen::Quaterniond> next(sum);
        next = (q * dq).normalized();
        for (int k = 0; k < 3; ++k) sum[4 + k] = x[4 + k] + d[3 + k];
        return true;
    }
    bool PlusJacobian(const double*, double* J) const override {
        RowMajor<7, 6> M(J);
        M.setZero();
        M.topRows<6>().setIdentity();
        return true;
    }
    bool Minus(const double* y, const double* x, double* d) const override {
        const Eigen::Map<const Eigen::Quaterniond> qy(y), qx(x);
        Eigen::Map<Eigen::Vector3d> rotation(d);
        rotation = so3::log((qx.conjugate() * qy).toRotationMatrix());
        for (int k = 0; k < 3; ++k) d[3 + k] = y[4 + k] - x[4 + k];
        return true;
    }
    bool MinusJacobian(const double*, double* J) const override {
        RowMajor<6, 7> M(J);
        M.setZero();
        M.leftCols<6>().setIdentity();
        return true;
    }
};

// A vector of fixed norm.
class SphereManifold final : public ceres::Manifold {
 public:
    int AmbientSize() const override { return 3; }
    int TangentSize() const override { return 2; }
    bool Plus(const double* x, const double* d, double* sum) const override {
        const Eigen::Map<const Eigen::Vector3d> g(x);
        Eigen::Map<Eigen::Vector3d> next(sum);
        next = so3::exp(tangent_basis(g) * Eigen::Map<const Eigen::Vector2d>(d)) * g;
        return true;
    }
    bool PlusJacobian(const double* x, double* J) const override {
        const Eigen::Map<const Eigen::Vector3d> g(x);
        RowMajor<3, 2> M(J);
        M = -so3::skew(g) * tangent_basis(g);
        return true;
    }
    bool Minus(const double*, const double*, double*) const override { return false; }
    bool MinusJacobian(const double*, double*) const override { return false; }
};

struct FrameParameters {
    double pose[7], motion[9];  // motion: velocity, gyro bias, accelerometer bias
};

InertialState inertial_state(const double* pose, const double* motion) {
    InertialState state;
    state.R = Eigen::Map<const Eigen::Quaterniond>(pose).toRotationMatrix();
    state.p = Eigen::Map<const Eigen::Vector3d>(pose + 4);
    state.v = Eigen::Map<const Eigen::Vector3d>(motion);
    return state;
}

ImuBias bias_of(const double* motion) {
    return {Eigen::Map<const Eigen::Vector3d>(motion + 3),
            Eigen::Map<const Eigen::Vector3d>(motion + 6)};
}

class ImageCost final : public ceres::SizedCostFunction<2, 7, 3> {
 public:
    ImageCost(const Camera& camera, const Pose& T_C_I, const batch::Observation& observation)
        : camera_(camera), T_C_I_(T_C_I), observation_(observation) {}

    bool Evaluate(double const* const* x, double* residual, double** J) const override {
        const Eigen::Matrix3d R = Eigen::Map<const Eigen::Quaterniond>(x[0]).toRotationMatrix();
        const Eigen::Map<const Eigen::Vector3d> p(x[0] + 4), X(x[1]);
        const Eigen::Vector3d p_I = R.transpose() * (X - p);
        Matrix23d J_C;
        const auto uv = camera_.project(T_C_I_ * p_I, J ? &J_C : nullptr);
        if (!uv) return false;
        Eigen::Map<Eigen::Vector2d> r(residual);
        r = observation_.sqrt_information * (*uv - observation_.uv_px);
        if (!J) return true;
        const Matrix23d J_I = observation_.sqrt_information * J_C * T_C_I_.R;
        const Matrix23d J_X = J_I * R.transpose();
        if (J[0]) {
            RowMajor<2, 7> pose(J[0]);
            pose.leftCols<3>().noalias() = J_I * so3::skew(p_I);
            pose.middleCols<3>(3) = -J_X;
            pose.col(6).setZero();
        }
        if (J[1]) {
            RowMajor<2, 3> point(J[1]);
            point = J_X;
        }
        return true;
    }

 private:
    const Camera& camera_;
    const Pose& T_C_I_;
    const batch::Observation& observation_;
};

// Readings between two images, integrated at the biases of the last linearisation.
struct Interval {
    std::unique_ptr<PreintegratedImu> readings;
    Matrix9d sqrt_information;
    ImuBias bias;

    void integrate(const batch::Model& model, int i, const ImuBias& now) {
        bias = now;
        readings =
            std::make_unique<PreintegratedImu>(model.segments[i], bias, model.interval_noise[i]);
        sqrt_information = readings->covariance().llt().matrixL().solve(Matrix9d::Identity());
    }
};

class InertialCost final : public ceres::SizedCostFunction<9, 7, 9, 7, 9, 3> {
 public:
    explicit InertialCost(const Interval& interval) : interval_(interval) {}

    bool Evaluate(double const* const* x, double* residual, double** J) const override {
        const Eigen::Map<const Eigen::Vector3d> gravity(x[4]);
        PreintegratedImu::Jacobian D;
        const Matrix9d& L = interval_.sqrt_information;
        Eigen::Map<Vector9d> r(residual);
        r = L * interval_.readings->residual(inertial_state(x[0], x[1]), inertial_state(x[2], x[3]),
                                             bias_of(x[1]), gravity, J ? &D : nullptr);
        if (!J) return true;
        const Matrix9d Ji = L * D.state_i, Jj = L * D.state_j;
        const auto pose = [&](double* target, const Matrix9d& from) {
            RowMajor<9, 7> M(target);
            M.leftCols<6>() = from.leftCols<6>();
            M.col(6).setZero();
        };
        if (J[0]) pose(J[0], Ji);
        if (J[2]) pose(J[2], Jj);
        if (J[1]) {
            RowMajor<9, 9> motion(J[1]);
            motion << Ji.rightCols<3>(), L * D.bias;
        }
        if (J[3]) {
            RowMajor<9, 9> motion(J[3]);
            motion.leftCols<3>() = Jj.rightCols<3>();
            motion.rightCols<6>().setZero();
        }
        if (J[4]) {
            RowMajor<9, 3> gravity_part(J[4]);
            gravity_part = L * D.gravity;
        }
        return true;
    }

 private:
    const Interval& interval_;
};

// Difference of two frames' biases, or the bias of one: weights times it.
class BiasCost final : public ceres::CostFunction {
 public:
    BiasCost(Vector6d weights, bool difference) : weights_(std::move(weights)) {
        mutable_parameter_block_sizes()->assign(difference ? 2 : 1, 9);
        set_num_residuals(6);
    }
    bool Evaluate(double const* const* x, double* residual, double** J) const override {
        const bool difference = parameter_block_sizes().size() == 2;
        for (int k = 0; k < 6; ++k)
            residual[k] = weights_(k) * (difference ? x[1][3 + k] - x[0][3 + k] : x[0][3 + k]);
        for (size_t block = 0; J && block < parameter_block_sizes().size(); ++block) {
            if (!J[block]) continue;
            RowMajor<6, 9> M(J[block]);
            M.setZero();
            M.rightCols<6>().diagonal() = difference && block == 0 ? -weights_ : weights_;
        }
        return true;
    }

 private:
    Vector6d weights_;
};

// Integrates the readings anew where biases have moved, as the batch estimator does.
class Reintegrate final : public ceres::EvaluationCallback {
 public:
    Reintegrate(const batch::Model& model, std::vector<FrameParameters>& frames,
                std::deque<Interval>& intervals)
        : model_(model), frames_(frames), intervals_(intervals) {}
    void PrepareForEvaluation(bool jacobians, bool) override {
        if (!jacobians) return;
        for (size_t i = 0; i < intervals_.size(); ++i) {
            const ImuBias now = bias_of(frames_[i].motion), &then = intervals_[i].bias;
            if ((now.gyro - then.gyro).norm() > 1e-3 || (now.accel - then.accel).norm() > 1e-2)
                intervals_[i].integrate(model_, static_cast<int>(i), now);
        }
    }

 private:
    const batch::Model& model_;
    std::vector<FrameParameters>& frames_;
    std::deque<Interval>& intervals_;
};

Vector6d walk_weights(const batch::Model& model, int i) {
    const double s = std::sqrt(to_seconds(model.times[i + 1] - model.times[i]));
    Vector6d weights;
    weights << Eigen::Vector3d::Constant(1 / (model.noise.gyro_bias_random_walk * s)),
        Eigen::Vector3d::Constant(1 / (model.noise.accel_bias_random_walk * s));
    return weights;
}

}  // namespace

Solved solve_with_ceres(const batch::Model& model, const BatchOptions& options,
                        const batch::State& start, int threads) {
    const auto began = std::chrono::steady_clock::now();
    if (openblas_set_num_threads) openblas_set_num_threads(threads);
    omp_set_num_threads(threads);
    std::vector<FrameParameters> frames(model.frames());
    for (int i = 0; i < model.frames(); ++i) {
        const auto& from = start.frames[i];
        Eigen::Map<Eigen::Quaterniond> q(frames[i].pose);
        q = Eigen::Quaterniond(from.motion.R);
        Eigen::Map<Eigen::Vector3d> p(frames[i].pose + 4);
        p = from.motion.p;
        Eigen::Map<Vector9d> motion(frames[i].motion);
        motion << from.motion.v, from.bias.gyro, from.bias.accel;
    }
    std::vector<Eigen::Vector3d> points = start.points;
    Eigen::Vector3d gravity = start.gravity;
    std::deque<Interval> intervals(model.frames() - 1);
    for (int i = 0; i + 1 < model.frames(); ++i)
        intervals[i].integrate(model, i, start.frames[i].bias);
    Reintegrate reintegrate(model, frames, intervals);
    PoseManifold pose_manifold;
    SphereManifold sphere;

    ceres::Problem::Options problem_options;
    problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_options.evaluation_callback = &reintegrate;
    ceres::Problem problem(problem_options);
    const Pose T_C_I = model.T_I_C.inverse();
    for (FrameParameters& frame : frames) {
        problem.AddParameterBlock(frame.pose, 7, &pose_manifold);
        problem.AddParameterBlock(frame.motion, 9);
    }
    problem.AddParameterBlock(gravity.data(), 3, &sphere);
    problem.SetParameterBlockConstant(frames.front().pose);
    for (const batch::Observation& observation : model.observations)
        problem.AddResidualBlock(new ImageCost(*model.camera, T_C_I, observation), nullptr,
                                 frames[observation.frame_idx].pose,
                                 points[observation.point_idx].data());
    for (int i = 0; i + 1 < model.frames(); ++i) {
        problem.AddResidualBlock(new InertialCost(intervals[i]), nullptr, frames[i].pose,
                                 frames[i].motion, frames[i + 1].pose, frames[i + 1].motion,
                                 gravity.data());
        problem.AddResidualBlock(new BiasCost(walk_weights(model, i), true), nullptr,
                                 frames[i].motion, frames[i + 1].motion);
    }
    Vector6d prior;
    prior << Eigen::Vector3d::Constant(1 / options.gyro_bias_sigma),
        Eigen::Vector3d::Constant(1 / options.accel_bias_sigma);
    problem.AddResidualBlock(new BiasCost(prior, false), nullptr, frames.front().motion);

    ceres::Solver::Options solver;
    solver.linear_solver_type = ceres::SPARSE_SCHUR;
    solver.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    auto* ordering = new ceres::ParameterBlockOrdering;
    for (Eigen::Vector3d& point : points) ordering->AddElementToGroup(point.data(), 0);
    for (FrameParameters& frame : frames) {
        ordering->AddElementToGroup(frame.pose, 1);
        ordering->AddElementToGroup(frame.motion, 1);
    }
    ordering->AddElementToGroup(gravity.data(), 1);
    solver.linear_solver_ordering.reset(ordering);
    solver.num_threads = threads;
    solver.max_num_iterations = 200;
    solver.function_tolerance = 1e-9;
    solver.parameter_tolerance = 1e-9;
    solver.gradient_tolerance = 1e-12;
    solver.logging_type = ceres::SILENT;
    const double prepared =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    ceres::Solver::Summary summary;
    ceres::Solve(solver, &problem, &summary);

    Solved solved;
    solved.iterations = static_cast<int>(summary.iterations.size()) - 1;
    solved.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    solved.final_cost = 2 * summary.final_cost;
    solved.linear_seconds = summary.linear_solver_time_in_seconds;
    for (int k = 0; k < std::min(Solved::kSteps, solved.iterations + 1); ++k) {
        const ceres::IterationSummary& step = summary.iterations[k];
        solved.step_seconds[k] = prepared + step.cumulative_time_in_seconds;
        solved.step_cost[k] = 2 * step.cost;
    }
    solved.converged = summary.termination_type == ceres::CONVERGENCE;
    return solved;
}

}  // namespace vio::bench
