#include "libvio/batch/marginals.h"

#include <map>

#include "libvio/batch/published_frame.h"
#include "libvio/geometry/relative_pose.h"
#include "libvio/geometry/so3.h"

namespace vio::batch {
namespace {

// Nominal body state, and d(its 15 errors) / d(the solver's 15 errors of the frame, gravity 3).
struct BodyState {
    StateEstimate estimate;
    Eigen::Matrix<double, 15, 18> J;
};

BodyState body_state(const Model& model, const State& state, const Gauge& gauge, int i) {
    const State::Frame& frame = state.frames[i];
    const Eigen::Matrix3d& A = gauge.T_Wp_W.R;
    BodyState body;
    StateEstimate& e = body.estimate;
    e.t = model.times[i];
    e.T_W_B = gauge.T_Wp_W * body_pose(model, state, i);
    e.gyro_bias = frame.bias.gyro;
    e.accel_bias = frame.bias.accel;
    // Velocity of the body's origin: the IMU's plus rotation about it.
    Eigen::Vector3d swing = Eigen::Vector3d::Zero();
    if (model.inertial) swing = (model.gyro_at_image[i] - frame.bias.gyro).cross(model.T_I_B.p);
    e.v_W = A * (frame.motion.v + frame.motion.R * swing);

    const Eigen::Matrix3d R_B_I = model.T_I_B.R.transpose();
    const Eigen::Matrix3d AR = A * frame.motion.R;
    auto& J = body.J;
    J.setZero();
    J.block<3, 3>(kRotation, kRotation) = R_B_I;
    J.block<3, 3>(kPosition, kRotation) = -AR * so3::skew(model.T_I_B.p);
    J.block<3, 3>(kPosition, kPosition) = A;
    J.block<3, 3>(kVelocity, kRotation) = -AR * so3::skew(swing);
    J.block<3, 3>(kVelocity, kVelocity) = A;
    J.block<3, 3>(kVelocity, kGyroBias) = AR * so3::skew(model.T_I_B.p);
    J.bottomRightCorner<9, 9>().leftCols<6>().bottomRows<6>().setIdentity();
    if (gauge.depends_on_gravity) {
        const Eigen::Matrix3d& tilt = gauge.tilt_by_gravity;
        J.block<3, 3>(kRotation, 15) = e.T_W_B.R.transpose() * tilt;
        J.block<3, 3>(kPosition, 15) = -so3::skew(e.T_W_B.p) * tilt;
        J.block<3, 3>(kVelocity, 15) = -so3::skew(e.v_W) * tilt;
    }
    return body;
}

// Adds that to a covariance that begins with the 15 errors of a body state.
void add_curvature_of_bias(const Model& model, const Objective& objective, const State& state,
                           int frame, Eigen::Ref<Eigen::MatrixXd> covariance) {
    if (!model.inertial || objective.gravity_free()) return;
    auto bias = covariance.block<3, 3>(kAccelBias, kAccelBias);
    bias += curvature_of_bias(bias, state.frames[frame].motion.R.transpose() * state.gravity);
}

// Columns that pick the frame's 15 errors and gravity's 3 out of the reduced unknowns.
Eigen::MatrixXd selector(const Model& model, const Objective& objective, const State& state,
                         const Layout& layout, int size, int frame) {
    Eigen::MatrixXd E = Eigen::MatrixXd::Zero(size, 18);
    for (int c = 0; c < 15; ++c) {
        const bool held = frame == 0 && c < 6 && !model.surveyed();
        if (const int k = layout.index(frame, c); k >= 0 && !held) E(k, c) = 1;
    }
    if (layout.inertial)
        E.block<3, 3>(layout.gravity_index(), 15) =
            objective.gravity_jacobian(state.gravity).transpose();
    return E;
}

std::vector<int> observations_per_frame(const Model& model) {
    std::vector<int> counts(model.frames(), 0);
    for (const Observation& o : model.observations) counts[o.frame_idx] += o.active;
    return counts;
}

int active_observations(const Model& model, const Point& point) {
    int n = 0;
    for (int k = 0; k < point.observation_count; ++k)
        n += model.observations[point.first_observation + k].active;
    return n;
}

// Marginals of everything, from the entries of the inverse at the factor's places.
class Marginals {
 public:
    Marginals(const Model& model, const Objective& objective, const State& state,
              const NormalEquations& equations)
        : model_(model),
          equations_(equations),
          layout_(equations.layout()),
          shared_(equations.shared_errors()),
          inverse_(equations.factor().sparse_inverse()) {
        gravity_jacobian_ = objective.gravity_jacobian(state.gravity);
        if (!layout_.inertial) return;
        // Cross-covariances with the global block reach every frame: columns by solving.
        const int global = layout_.gravity_index(), dim = layout_.global_dim();
        Eigen::MatrixXd E = Eigen::MatrixXd::Zero(equations.matrix.size(), dim);
        E.middleRows(global, dim).setIdentity();
        with_global_ = equations.factor().solve(E);
    }

    Eigen::Matrix<double, 18, 18> frame_and_gravity(int frame) const {
        Eigen::Matrix<double, 18, 18> S = Eigen::Matrix<double, 18, 18>::Zero();
        for (int r = 0; r < 15; ++r)
            for (int c = 0; c <= r; ++c) S(r, c) = S(c, r) = entry(frame, r, c);
        if (layout_.inertial) {
            Eigen::Matrix<double, 3, 18> cross = Eigen::Matrix<double, 3, 18>::Zero();
            for (int c = 0; c < 15; ++c)
                if (known(frame, c))
                    cross.col(c) = gravity_jacobian_ *
                                   with_global_.row(layout_.index(frame, c)).head<3>().transpose();
            S.bottomRows<3>() = cross;
            S.rightCols<3>() = cross.transpose();
            S.bottomRightCorner<3, 3>() = own_gravity();
        }
        if (shared_) add_shared(S, moved_frame_and_gravity(frame));
        return S;
    }

    // Joint covariance of the poses of two frames, six errors each.
    Eigen::Matrix<double, 12, 12> two_poses(int a, int b) const {
        Eigen::Matrix<double, 12, 12> S = Eigen::Matrix<double, 12, 12>::Zero();
        if (known(a, 0)) S.topLeftCorner<6, 6>() = cross_of_poses(a, a);
        if (known(b, 0)) S.bottomRightCorner<6, 6>() = cross_of_poses(b, b);
        if (known(a, 0) && known(b, 0)) {
            S.topRightCorner<6, 6>() = cross_of_poses(a, b);
            S.bottomLeftCorner<6, 6>() = S.topRightCorner<6, 6>().transpose();
        }
        if (shared_) {
            Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(12, shared_->covariance.rows());
            if (known(a, 0))
                moved.topRows<6>() = shared_->reduced.middleRows<6>(layout_.index(a, 0));
            if (known(b, 0))
                moved.bottomRows<6>() = shared_->reduced.middleRows<6>(layout_.index(b, 0));
            add_shared(S, moved);
        }
        return S;
    }

    Eigen::Matrix3d gravity() const {
        Eigen::Matrix3d S = own_gravity();
        if (shared_) add_shared(S, moved_gravity());
        return S;
    }

    // Covariance of the point, and its cross-covariance with gravity (3 x 3).
    std::pair<Eigen::Matrix3d, Eigen::Matrix3d> point(int j) const {
        auto [S, cross] = own_point(j);
        if (!shared_) return {S, cross};
        const auto moved = shared_->points.middleRows<3>(3 * static_cast<Eigen::Index>(j));
        add_shared(S, moved);
        if (layout_.inertial) cross += moved * shared_->covariance * moved_gravity().transpose();
        return {S, cross};
    }

 private:
    // What shared errors add to the covariance of unknowns that move with them.
    template <typename Matrix>
    void add_shared(Matrix& S, const Eigen::MatrixXd& moved) const {
        S += moved * shared_->covariance * moved.transpose();
    }
    Eigen::MatrixXd moved_gravity() const {
        return gravity_jacobian_ * shared_->reduced.middleRows<3>(layout_.gravity_index());
    }
    Eigen::MatrixXd moved_frame_and_gravity(int frame) const {
        Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(18, shared_->covariance.rows());
        for (int c = 0; c < 15; ++c)
            if (known(frame, c)) moved.row(c) = shared_->reduced.row(layout_.index(frame, c));
        if (layout_.inertial) moved.bottomRows<3>() = moved_gravity();
        return moved;
    }

    Eigen::Matrix3d own_gravity() const {
        return gravity_jacobian_ * with_global_.block<3, 3>(layout_.gravity_index(), 0) *
               gravity_jacobian_.transpose();
    }

    std::pair<Eigen::Matrix3d, Eigen::Matrix3d> own_point(int j) const {
        const int slot = layout_.border_of_point[j];
        Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
        if (slot >= 0) {
            const int k = equations_.matrix.offset(layout_.border_block(slot));
            if (layout_.inertial)
                cross = with_global_.block<3, 3>(k, 0) * gravity_jacobian_.transpose();
            const int block = layout_.border_block(slot);
            return {inverse_.block(block, block), cross};
        }
        // X = -V^-1 W^T x + noise of V^-1: sum over the pairs of images that see it.
        const Point& p = model_.points[j];
        Eigen::Matrix3d S = equations_.point_inverse(j);
        std::vector<Matrix63d> T;
        std::vector<int> frames;
        for (int k = p.first_observation; k < p.first_observation + p.observation_count; ++k) {
            if (!model_.observations[k].active || equations_.W[k].isZero(0)) continue;
            T.push_back(equations_.W[k] * equations_.point_inverse(j));
            frames.push_back(model_.observations[k].frame_idx);
        }
        for (size_t a = 0; a < T.size(); ++a) {
            const int row = layout_.index(frames[a], 0);
            for (size_t c = 0; c <= a; ++c) {
                const Eigen::Matrix3d part =
                    T[a].transpose() *
                    pair(layout_.pose_block(frames[a]), layout_.pose_block(frames[c])) * T[c];
                S += part;
                if (c != a) S += part.transpose();
            }
            if (layout_.inertial)
                cross -= T[a].transpose() * with_global_.block<6, 3>(row, 0) *
                         gravity_jacobian_.transpose();
        }
        return {S, cross};
    }

    bool known(int frame, int component) const {
        const bool held = frame == 0 && component < 6 && !model_.surveyed();
        return !held && layout_.index(frame, component) >= 0;
    }
    Matrix6d cross_of_poses(int a, int b) const {
        const int A = layout_.pose_block(a), B = layout_.pose_block(b);
        if (inverse_.holds(A, B)) return pair(A, B);
        // Frames that no point connects: columns of the inverse by solving.
        Eigen::MatrixXd E = Eigen::MatrixXd::Zero(equations_.matrix.size(), 6);
        E.middleRows<6>(layout_.index(b, 0)).setIdentity();
        return equations_.factor().solve(E).middleRows<6>(layout_.index(a, 0));
    }
    double entry(int frame, int r, int c) const {
        if (!known(frame, r) || !known(frame, c)) return 0;
        const auto block = [&](int component) {
            return component < 6                             ? layout_.pose_block(frame)
                   : component < 9 || layout_.bias_per_frame ? layout_.motion_block(frame)
                                                             : layout_.global_block();
        };
        const int R = block(r), C = block(c);
        const int row = layout_.index(frame, r) - equations_.matrix.offset(R),
                  col = layout_.index(frame, c) - equations_.matrix.offset(C);
        return pair(R, C)(row, col);
    }
    const Eigen::MatrixXd& pair(int row_block, int col_block) const {
        auto& cached = pairs_[{row_block, col_block}];
        if (cached.size() == 0) cached = inverse_.block(row_block, col_block);
        return cached;
    }

    const Model& model_;
    const NormalEquations& equations_;
    const Layout& layout_;
    const std::optional<SharedErrors>& shared_;
    BlockCholesky::SparseInverse inverse_;
    Eigen::Matrix3d gravity_jacobian_;
    Eigen::MatrixXd with_global_;
    mutable std::map<std::pair<int, int>, Eigen::MatrixXd> pairs_;
};

// Position and velocity of a body.
Vector6d position_and_velocity(const StateEstimate& e) {
    Vector6d vectors;
    vectors << e.T_W_B.p, e.v_W;
    return vectors;
}

// d(point in W') / d(gravity) given the point in W'.
Eigen::Matrix3d point_by_gravity(const Gauge& gauge, const Eigen::Vector3d& p_Wp) {
    return -so3::skew(p_Wp) * gauge.tilt_by_gravity;
}

// The gauge, which moves both poses alike, does not touch the motion between them.
RelativeMotion motion_between(const Model& model, const State& state, const Marginals* marginals,
                              int a, int b) {
    const auto body_jacobian = [&](int frame) {
        const InertialState& I = state.frames[frame].motion;
        return right_compose_jacobian({I.R, I.p}, model.T_I_B);
    };
    const RelativePose relative =
        relative_pose(body_pose(model, state, a), body_pose(model, state, b));
    RelativeMotion motion{model.times[a], model.times[b], relative.T_A_B};
    if (!marginals) return motion;
    Eigen::Matrix<double, 6, 12> J = relative.J;
    J.leftCols<6>() = (J.leftCols<6>() * body_jacobian(a)).eval();
    J.rightCols<6>() = (J.rightCols<6>() * body_jacobian(b)).eval();
    motion.covariance = J * marginals->two_poses(a, b) * J.transpose();
    return motion;
}

}  // namespace

Estimate publish(const Model& model, const Objective& objective, const State& state,
                 const std::vector<int>& keyframes, const NormalEquations* equations) {
    const Gauge gauge = make_gauge(model, state);
    const Eigen::Matrix3d& A = gauge.T_Wp_W.R;
    Estimate estimate;
    estimate.has_scale = model.inertial || model.surveyed();
    estimate.g_W = A * state.gravity;
    const std::vector<int> features = observations_per_frame(model);

    std::optional<Marginals> marginals;
    if (equations) marginals.emplace(model, objective, state, *equations);

    for (int i = 0; i < model.frames(); ++i) {
        BodyState body = body_state(model, state, gauge, i);
        if (marginals) {
            Matrix15d& covariance = body.estimate.covariance;
            const Eigen::Matrix<double, 18, 18> S = marginals->frame_and_gravity(i);
            covariance = body.J * S * body.J.transpose();
            if (gauge.depends_on_gravity)
                covariance.block<6, 6>(kPosition, kPosition) +=
                    Turning<6>(gauge, position_and_velocity(body.estimate),
                               body.J.middleRows<6>(kPosition), S, 15)
                        .second_moment();
            add_curvature_of_bias(model, objective, state, i, covariance);
        }
        body.estimate.features = features[i];
        estimate.states.push_back(body.estimate);
    }
    if (marginals && model.inertial) {
        estimate.gravity_covariance = A * marginals->gravity() * A.transpose();
        // Where gravity makes W's z axis, its tilt is that of the poses and landmarks.
        if (gauge.depends_on_gravity) {
            const double along = estimate.gravity_covariance(2, 2);
            estimate.gravity_covariance = Eigen::Vector3d(0, 0, along).asDiagonal();
        }
    }
    for (size_t j = 0; j < model.points.size(); ++j) {
        LandmarkEstimate landmark;
        landmark.id = model.points[j].id;
        landmark.p_W = gauge.T_Wp_W * state.points[j];
        landmark.observations = active_observations(model, model.points[j]);
        if (landmark.observations < 2) continue;
        if (marginals) {
            const auto [S, cross] = marginals->point(static_cast<int>(j));
            const Eigen::Matrix3d J = point_by_gravity(gauge, landmark.p_W);
            landmark.covariance = A * S * A.transpose();
            if (gauge.depends_on_gravity) {
                Eigen::Matrix<double, 3, 6> J_all;
                J_all << A, J;
                Matrix6d joint;
                joint << S, cross, cross.transpose(), marginals->gravity();
                landmark.covariance =
                    J_all * joint * J_all.transpose() +
                    Turning<3>(gauge, landmark.p_W, J_all, joint, 3).second_moment();
            }
        }
        estimate.landmarks.push_back(landmark);
    }
    for (size_t k = 1; k < keyframes.size(); ++k)
        estimate.keyframe_motions.push_back(motion_between(
            model, state, marginals ? &*marginals : nullptr, keyframes[k - 1], keyframes[k]));
    return estimate;
}

namespace {

// Adds what turns to the covariance of a tail, errors J x with x of covariance S.
void add_turning(const Gauge& gauge, const Eigen::MatrixXd& J, const Eigen::MatrixXd& S,
                 BatchTail& tail) {
    if (!gauge.depends_on_gravity) return;
    const Eigen::Index points = 3 * static_cast<Eigen::Index>(tail.landmarks.size());
    Eigen::VectorXd vectors(6 + points);
    vectors.head<6>() = position_and_velocity(tail.state);
    for (size_t a = 0; a < tail.landmarks.size(); ++a)
        vectors.segment<3>(6 + 3 * static_cast<Eigen::Index>(a)) = tail.landmarks[a].p_W;
    Eigen::MatrixXd J_turning(6 + points, J.cols());
    J_turning << J.middleRows<6>(kPosition), J.bottomRows(points);
    const Eigen::MatrixXd moment =
        Turning<Eigen::Dynamic>(gauge, vectors, J_turning, S, 15).second_moment();
    tail.covariance.block<6, 6>(kPosition, kPosition) += moment.topLeftCorner<6, 6>();
    tail.covariance.block(kPosition, 15, 6, points) += moment.topRightCorner(6, points);
    tail.covariance.block(15, kPosition, points, 6) += moment.bottomLeftCorner(points, 6);
    tail.covariance.bottomRightCorner(points, points) += moment.bottomRightCorner(points, points);
}

}  // namespace

BatchTail publish_tail(const Model& model, const Objective& objective, const State& state,
                       const NormalEquations& equations) {
    const Layout& layout = equations.layout();
    const Gauge gauge = make_gauge(model, state);
    const int size = equations.matrix.size(), last = model.frames() - 1;
    std::vector<int> points;
    for (const Observation& o : model.observations)
        if (o.active && o.frame_idx == last &&
            active_observations(model, model.points[o.point_idx]) >= 3)
            points.push_back(o.point_idx);

    // Joint error = E^T x (+ own noise of eliminated points); covariance E^T A^-1 E + ....
    const int n = static_cast<int>(points.size());
    Eigen::MatrixXd E = Eigen::MatrixXd::Zero(size, 18 + 3 * n);
    E.leftCols(18) = selector(model, objective, state, layout, size, last);
    for (int a = 0; a < n; ++a) {
        const int j = points[a], slot = layout.border_of_point[j];
        if (slot >= 0) {
            E.block<3, 3>(equations.matrix.offset(layout.border_block(slot)), 18 + 3 * a)
                .setIdentity();
            continue;
        }
        const Point& p = model.points[j];
        for (int k = p.first_observation; k < p.first_observation + p.observation_count; ++k)
            if (model.observations[k].active)
                E.block<6, 3>(layout.index(model.observations[k].frame_idx, 0), 18 + 3 * a) -=
                    equations.W[k] * equations.point_inverse(j);
    }
    Eigen::MatrixXd joint = E.transpose() * equations.factor().solve(E);
    for (int a = 0; a < n; ++a)
        if (layout.border_of_point[points[a]] < 0)
            joint.block<3, 3>(18 + 3 * a, 18 + 3 * a) += equations.point_inverse(points[a]);
    Eigen::MatrixXd with_rig;
    if (const auto& shared = equations.shared_errors()) {
        Eigen::MatrixXd moved = E.transpose() * shared->reduced;
        for (int a = 0; a < n; ++a)
            moved.middleRows<3>(18 + 3 * a) = shared->points.middleRows<3>(3L * points[a]);
        const Eigen::MatrixXd with_shared = moved * shared->covariance;
        joint += with_shared * moved.transpose();
        if (const auto& rig = equations.rig_solution())
            with_rig = with_shared.leftCols(rig->covariance.rows());
    }

    const BodyState body = body_state(model, state, gauge, last);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(15 + 3 * n, 18 + 3 * n);
    J.topLeftCorner<15, 18>() = body.J;
    BatchTail tail;
    tail.state = body.estimate;
    tail.g_W = gauge.T_Wp_W.R * state.gravity;
    for (int a = 0; a < n; ++a) {
        LandmarkEstimate landmark;
        landmark.id = model.points[points[a]].id;
        landmark.p_W = gauge.T_Wp_W * state.points[points[a]];
        landmark.observations = active_observations(model, model.points[points[a]]);
        J.block<3, 3>(15 + 3 * a, 18 + 3 * a) = gauge.T_Wp_W.R;
        if (gauge.depends_on_gravity)
            J.block<3, 3>(15 + 3 * a, 15) = point_by_gravity(gauge, landmark.p_W);
        tail.landmarks.push_back(landmark);
    }
    tail.covariance = J * joint * J.transpose();
    if (with_rig.size() > 0) tail.with_rig = J * with_rig;
    tail.covariance = (0.5 * (tail.covariance + tail.covariance.transpose())).eval();
    add_curvature_of_bias(model, objective, state, last, tail.covariance);
    add_turning(gauge, J, joint, tail);
    tail.state.covariance = tail.covariance.topLeftCorner<15, 15>();
    for (int a = 0; a < n; ++a)
        tail.landmarks[a].covariance = tail.covariance.block<3, 3>(15 + 3 * a, 15 + 3 * a);
    return tail;
}

}  // namespace vio::batch
