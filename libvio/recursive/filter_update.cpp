// Updates of the whole state, and what consistency asks of them; see filter_state.h.
#include <algorithm>

#include "libvio/geometry/so3.h"
#include "libvio/recursive/filter_state.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kConverged = 0.05;  // standard deviations of a measurement

}  // namespace

Vector2d FilterState::applied(const PointRows& row, const VectorXd& d) const {
    return row.J_pose * d.head<6>() +
           row.J_anchor * d.segment<6>(clone_offset(landmarks_[row.landmark_idx].anchor)) +
           row.J_landmark * d.segment<3>(landmark_offset(row.landmark_idx));
}

// P H^T and S = H P H^T + I for landmarks seen from the core pose. H = J + (J change) reading^T
// with fifteen columns of J per pair of rows; the second part, if any, carries the scale.
void FilterState::gain(const std::vector<PointRows>& rows, const VectorXd& scale_change,
                       const VectorXd& scale_reading) {
    const int m = 2 * static_cast<int>(rows.size());
    PHt_.resize(size_, m);
    S_.resize(m, m);
    const auto anchor_offset = [&](const PointRows& row) {
        return clone_offset(landmarks_[row.landmark_idx].anchor);
    };
    for (int i = 0; i < m / 2; ++i) {
        const PointRows& row = rows[i];
        auto columns = PHt_.middleCols<2>(2 * i);
        columns.noalias() = P_.topLeftCorner(size_, 6).lazyProduct(row.J_pose.transpose());
        columns.noalias() +=
            P_.block(0, anchor_offset(row), size_, 6).lazyProduct(row.J_anchor.transpose());
        columns.noalias() += P_.block(0, landmark_offset(row.landmark_idx), size_, 3)
                                 .lazyProduct(row.J_landmark.transpose());
    }
    VectorXd J_change(m);
    if (scale_change.size() > 0) {
        const VectorXd P_reading = P() * scale_reading;
        for (int i = 0; i < m / 2; ++i) J_change.segment<2>(2 * i) = applied(rows[i], scale_change);
        PHt_.noalias() += P_reading * J_change.transpose();
    }
    for (int i = 0; i < m / 2; ++i) {
        const PointRows& row = rows[i];
        const int columns = 2 * i + 2;
        auto S_row = S_.block(2 * i, 0, 2, columns);
        S_row.noalias() = row.J_pose.lazyProduct(PHt_.block(0, 0, 6, columns));
        S_row.noalias() += row.J_anchor.lazyProduct(PHt_.block(anchor_offset(row), 0, 6, columns));
        S_row.noalias() += row.J_landmark.lazyProduct(
            PHt_.block(landmark_offset(row.landmark_idx), 0, 3, columns));
    }
    if (scale_change.size() > 0)
        S_.noalias() += J_change * (scale_reading.transpose() * PHt_).eval();
    S_.diagonal().array() += 1;
    llt_.compute(S_);
}

void FilterState::gain(const MatrixXd& H) {
    PHt_.noalias() = P_.topLeftCorner(size_, H.cols()) * H.transpose();
    S_.noalias() = H * PHt_.topRows(H.cols());
    S_.diagonal().array() += 1;
    llt_.compute(S_);
}

MatrixXd FilterState::projected_covariance(const MatrixXd& H) const {
    const MatrixXd PHt = P_.topLeftCorner(H.cols(), H.cols()) * H.transpose();
    return H * PHt;
}

// P -= (P H^T) S^-1 (H P), by way of W = L^-1 H P so that the result stays symmetric.
void FilterState::reduce_covariance() {
    W_ = PHt_.transpose();
    llt_.matrixL().solveInPlace(W_);
    auto P_now = P();
    P_now.selfadjointView<Eigen::Lower>().rankUpdate(W_.transpose(), -1.0);
    P_now.triangularView<Eigen::StrictlyUpper>() = P_now.transpose();
}

// Errors of a pose at the prior moved by delta, from those at the prior; see the header's head.
Matrix6d FilterState::pose_carrier(const Vector6d& delta, const Matrix3d& R_before) const {
    Matrix6d T = Matrix6d::Identity();
    if (!invariant_) return T;
    T.topLeftCorner<3, 3>() = so3::exp(-delta.head<3>());
    T.bottomLeftCorner<3, 3>() = -so3::skew(delta.tail<3>()) * R_before;
    return T;
}

// Whether the residuals at the prior moved by delta are as those at the prior, with their rows,
// say.
bool FilterState::linear_until(const Linearise& linearise, const std::vector<PointRows>& rows,
                               const VectorXd& residual, const VectorXd& delta) const {
    std::vector<PointRows> there;
    linearise(delta, &there);
    if (there.size() != rows.size()) return false;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        const Vector2d predicted =
            residual.segment<2>(2 * static_cast<Eigen::Index>(i)) - applied(rows[i], delta);
        if (there[i].landmark_idx != rows[i].landmark_idx ||
            (there[i].residual - predicted).lpNorm<Eigen::Infinity>() > kConverged)
            return false;
    }
    return true;
}

// The correction with the scale's sensitivity changed by from_noise, the rows being good as they
// are: H becomes H + u reading^T with u = H from_noise, which changes the factor of S by two ranks.
// scale: correction of scale so far.
VectorXd FilterState::without_noise(const std::vector<PointRows>& rows, const VectorXd& from_noise,
                                    const VectorXd& reading, double scale, const VectorXd& residual,
                                    VectorXd* weighted) {
    VectorXd u(residual.size());
    for (std::size_t i = 0; i < rows.size(); ++i)
        u.segment<2>(2 * static_cast<Eigen::Index>(i)) = applied(rows[i], from_noise);
    const VectorXd P_reading = P() * reading;
    const VectorXd half = PHt_.transpose() * reading + 0.5 * reading.dot(P_reading) * u;
    PHt_.noalias() += P_reading * u.transpose();
    llt_.rankUpdate(u + half, 0.5);
    llt_.rankUpdate(u - half, -0.5);
    *weighted = llt_.solve(residual + scale * u);
    return PHt_ * *weighted;
}

int FilterState::update(const Linearise& linearise, int max_iterations) {
    std::vector<PointRows> rows;
    VectorXd delta = VectorXd::Zero(size_), residual, weighted, next;
    const VectorXd reading = invariant_ ? scale_reading() : VectorXd();
    doubt_sensitivity();
    const VectorXd scale_before = scale_direction(VectorXd::Zero(size_));
    VectorXd scale_change, from_noise;
    int iteration = 0;
    while (true) {
        linearise(delta, &rows);
        if (rows.empty()) return 0;
        residual.resize(2 * static_cast<Eigen::Index>(rows.size()));
        // Jacobians with respect to the errors at the prior, which are carried to this iterate.
        const Matrix6d core = pose_carrier(delta.head<6>(), core_.T_W_I.R);
        std::vector<Matrix6d> clone;
        for (int i = 0; i < static_cast<int>(clones_.size()); ++i)
            clone.push_back(pose_carrier(delta.segment<6>(clone_offset(i)), clones_[i].T_W_I.R));
        for (std::size_t i = 0; i < rows.size(); ++i) {
            PointRows& row = rows[i];
            row.J_pose = (row.J_pose * core).eval();
            row.J_anchor = (row.J_anchor * clone[landmarks_[row.landmark_idx].anchor]).eval();
        }
        if (iteration > 0 && reading.size() > 0) {
            scale_change = scale_direction(delta) - scale_before;
            if (in_variables_) scale_change += from_noise;
        }
        const double scale = scale_change.size() > 0 ? reading.dot(delta) : 0;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            auto r = residual.segment<2>(2 * static_cast<Eigen::Index>(i));
            r = rows[i].residual + applied(rows[i], delta);
            if (scale_change.size() > 0) r += scale * applied(rows[i], scale_change);
        }
        gain(rows, scale_change, reading);
        weighted = llt_.solve(residual);
        if (iteration == 0) innovations_.add(residual, residual.dot(weighted));
        next.noalias() = PHt_ * weighted;
        if (in_variables_) from_noise = sensitivity_change(window_jacobian(rows), weighted);
        ++iteration;
        if (iteration == 1 && max_iterations > 1 && linear_until(linearise, rows, residual, next)) {
            if (from_noise.size() > 0 && reading.size() > 0) {
                next = without_noise(rows, from_noise, reading, reading.dot(next), residual,
                                     &weighted);
                from_noise = sensitivity_change(window_jacobian(rows), weighted);
            }
            delta.swap(next);
            break;
        }
        double change = 0;
        const VectorXd step = next - delta;
        for (const PointRows& row : rows)
            change = std::max(change, applied(row, step).lpNorm<Eigen::Infinity>());
        delta.swap(next);
        if (iteration >= max_iterations || change < kConverged) break;
    }
    reduce_covariance();
    if (in_variables_) update_sensitivity(window_jacobian(rows));
    correct(delta, from_noise);
    return iteration;
}

MatrixXd FilterState::window_jacobian(const std::vector<PointRows>& rows) const {
    MatrixXd H = MatrixXd::Zero(2 * static_cast<Eigen::Index>(rows.size()), window_size());
    for (Eigen::Index i = 0; i < static_cast<Eigen::Index>(rows.size()); ++i) {
        const int anchor = landmarks_[rows[i].landmark_idx].anchor;
        H.block<2, 6>(2 * i, 0) = rows[i].J_pose;
        H.block<2, 6>(2 * i, clone_offset(anchor)) = rows[i].J_anchor;
    }
    return H;
}

void FilterState::update(const MatrixXd& H, const VectorXd& residual) {
    doubt_sensitivity();
    gain(H);
    const VectorXd weighted = llt_.solve(residual);
    innovations_.add(residual, residual.dot(weighted));
    const VectorXd delta = PHt_ * weighted;
    VectorXd from_noise;
    if (in_variables_) from_noise = sensitivity_change(H, weighted);
    reduce_covariance();
    if (in_variables_) update_sensitivity(H);
    correct(delta, from_noise);
}

// What an innovation, weighted by S^-1, changes in the errors' sensitivity to scale; see
// errors_in_variables.h.
VectorXd FilterState::sensitivity_change(const MatrixXd& H, const VectorXd& weighted) const {
    VectorXd change = VectorXd::Zero(size_);
    change.head(window_size()) = -in_variables_->correlation() * (H.transpose() * weighted);
    return change;
}

// errors_in_variables.h is of first order: after a while without images, corrections of velocity
// are too large for it.
void FilterState::doubt_sensitivity() {
    constexpr double kKnown = 0.05;  // [m/s]
    if (in_variables_ && P_.diagonal().segment<3>(kVelocity).maxCoeff() > kKnown * kKnown)
        in_variables_->forget();
}

// For the update with H whose factors are in the work space.
void FilterState::update_sensitivity(const MatrixXd& H) {
    in_variables_->update(llt_.matrixL().solve(H), W_.leftCols(window_size()));
}

// Moves the mean, and the covariance with it: P <- T P T^T with T of the header's head, which
// touches the rows and columns of the core and of each clone.
void FilterState::correct(const VectorXd& delta, const VectorXd& from_noise) {
    if (invariant_) {
        const VectorXd reading = scale_reading();
        if (reading.size() > 0) {
            VectorXd change = scale_direction(delta) - scale_direction(VectorXd::Zero(size_));
            if (from_noise.size() > 0) change += from_noise;
            carry_scale(change, reading);
        }
    }
    const CoreState before = core_;
    core_ = moved(core_, delta.head(core_size_));
    if (invariant_) carry(0, core_carrier(delta.head(core_size_), before, core_));
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        const Vector6d own = delta.segment<6>(clone_offset(i));
        if (invariant_) carry(clone_offset(i), pose_carrier(own, clones_[i].T_W_I.R));
        clones_[i].T_W_I = clones_[i].T_W_I.boxplus(own);
    }
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i)
        landmarks_[i].point.x += delta.segment<3>(landmark_offset(i));
}

// Direction of scale at the mean moved by delta; see the header's head.
VectorXd FilterState::scale_direction(const VectorXd& delta) const {
    VectorXd n = VectorXd::Zero(size_);
    const Vector3d origin = core_.T_W_I.p + delta.segment<3>(kPosition);
    if (core_size_ > kVelocity) n.segment<3>(kVelocity) = core_.v_W + delta.segment<3>(kVelocity);
    if (core_size_ > kAcceleration)
        n.segment<3>(kAcceleration) = core_.a_W + delta.segment<3>(kAcceleration);
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        const int at = clone_offset(i) + kPosition;
        n.segment<3>(at) = clones_[i].T_W_I.p + delta.segment<3>(at) - origin;
    }
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i) {
        const int at = landmark_offset(i) + 2;
        n(at) = -(landmarks_[i].point.x.z() + delta(at));
    }
    return n;
}

// What reads the scale's error from the errors of the state: the mean of the landmarks' relative
// inverse distances, weighted by their precision. Empty without landmarks.
VectorXd FilterState::scale_reading() const {
    VectorXd s = VectorXd::Zero(size_);
    double sum = 0;
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i) {
        const int at = landmark_offset(i) + 2;
        const double rho = landmarks_[i].point.x.z();
        if (!landmarks_[i].point.in_front()) continue;
        const double weight = rho * rho / P_(at, at);
        s(at) = -weight / rho;
        sum += weight;
    }
    if (!(sum > 0)) return {};
    return s / sum;
}

void FilterState::carry_scale(const VectorXd& change, const VectorXd& reading) {
    const VectorXd P_reading = P() * reading;
    const VectorXd half = P_reading + 0.5 * reading.dot(P_reading) * change;
    auto P_now = P();
    P_now.selfadjointView<Eigen::Lower>().rankUpdate(half, change, 1.0);
    P_now.triangularView<Eigen::StrictlyUpper>() = P_now.transpose();
}

// The errors from `at` on become T times what they were.
void FilterState::carry(int at, const CoreMatrix& T) {
    if (in_variables_) in_variables_->carry(at, T);
    const Eigen::Index n = T.rows();
    const CoreMatrix own = P_.block(at, at, n, n);
    const MatrixXd rows = T * P_.block(at, 0, n, size_);
    P_.block(at, 0, n, size_) = rows;
    P_.block(0, at, size_, n) = rows.transpose();
    const CoreMatrix moved_own = T * own * T.transpose();
    P_.block(at, at, n, n) = 0.5 * (moved_own + moved_own.transpose());
}

}  // namespace vio
