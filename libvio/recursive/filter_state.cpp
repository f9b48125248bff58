#include "libvio/recursive/filter_state.h"

#include <algorithm>
#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

FilterState::FilterState(CoreKind kind, const CoreState& mean, const CoreMatrix& covariance,
                         bool invariant)
    : core_size_(static_cast<int>(kind)),
      size_(core_size_),
      invariant_(invariant),
      core_(mean),
      P_(MatrixXd::Zero(core_size_, core_size_)) {
    P() = covariance;
    waiting_.transition = CoreMatrix::Identity(core_size_, core_size_);
    waiting_.information = CoreMatrix::Zero(core_size_, core_size_);
    waiting_.vector = CoreVector::Zero(core_size_);
}

void FilterState::start_landmarks(const std::vector<LandmarkState>& landmarks,
                                  const MatrixXd& joint_covariance) {
    landmarks_ = landmarks;
    const int size = window_size() + 3 * static_cast<int>(landmarks.size());
    reserve(size);
    size_ = size;
    P() = joint_covariance;
}

int FilterState::find_clone(int image_idx) const {
    for (std::size_t i = 0; i < clones_.size(); ++i)
        if (clones_[i].image_idx == image_idx) return static_cast<int>(i);
    return -1;
}

void FilterState::reserve(int size) {
    if (size <= P_.rows()) return;
    const int capacity = std::max<int>(size, 3 * static_cast<int>(P_.rows()) / 2);
    MatrixXd larger = MatrixXd::Zero(capacity, capacity);
    larger.topLeftCorner(size_, size_) = P();
    P_.swap(larger);
}

CoreState FilterState::moved(const CoreState& core, const Eigen::Ref<const VectorXd>& delta) {
    CoreState x = core;
    x.T_W_I = core.T_W_I.boxplus(delta.head<6>());
    if (delta.size() < static_cast<int>(CoreKind::inertial)) return x;
    x.v_W += delta.segment<3>(kVelocity);
    x.gyro_bias += delta.segment<3>(kGyroBias);
    x.accel_bias += delta.segment<3>(kAccelBias);
    if (delta.size() < static_cast<int>(CoreKind::smooth)) return x;
    x.g_W += delta.segment<3>(kGravity);
    x.omega_I += delta.segment<3>(kAngularRate);
    x.a_W += delta.segment<3>(kAcceleration);
    return x;
}

// ---- The core alone ---------------------------------------------------------------------------

void FilterState::propagate(const CoreState& mean, const CoreMatrix& transition,
                            const CoreMatrix& noise) {
    core_ = mean;
    auto P_cc = P_.topLeftCorner(core_size_, core_size_);
    const CoreMatrix FP = transition * P_cc;
    CoreMatrix next = FP * transition.transpose();
    next += noise;
    P_cc = 0.5 * (next + next.transpose());
    waiting_.transition = (transition * waiting_.transition).eval();
    waiting_.any = true;
}

void FilterState::update_core(const LineariseCore& linearise, int iterations) {
    using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
    auto P_cc = P_.topLeftCorner(core_size_, core_size_);
    const CoreState before = core_;
    CoreVector delta = CoreVector::Zero(core_size_);
    CoreRows H;
    CoreResidual residual;
    CoreMatrix PHt, carrier = CoreMatrix::Identity(core_size_, core_size_);
    Eigen::LLT<Small> llt;
    for (int i = 0; i < iterations; ++i) {
        linearise(core_, &H, &residual);
        H = (H * carrier).eval();
        residual += H * delta;
        PHt = P_cc * H.transpose();
        Small S = H * PHt;
        S.diagonal().array() += 1;
        llt.compute(S);
        delta = PHt * llt.solve(residual);
        core_ = moved(before, delta);
        carrier = core_carrier(delta, before, core_);
    }
    const CoreMatrix HtSi = llt.solve(H).transpose();
    CoreMatrix reduction = CoreMatrix::Identity(core_size_, core_size_);
    reduction -= P_cc * HtSi * H;
    const CoreMatrix& F = waiting_.transition;
    waiting_.information += F.transpose() * (HtSi * H) * F;
    waiting_.vector += F.transpose() * (HtSi * residual);

    const CoreMatrix next = carrier * (reduction * P_cc) * carrier.transpose();
    P_cc = 0.5 * (next + next.transpose());
    waiting_.transition = (carrier * reduction * waiting_.transition).eval();
    waiting_.any = waiting_.measured = true;
}

// Carries the core's errors from one mean to another; see the head of the header.
CoreMatrix FilterState::core_carrier(const Eigen::Ref<const VectorXd>& delta,
                                     const CoreState& before, const CoreState& after) const {
    CoreMatrix T = CoreMatrix::Identity(core_size_, core_size_);
    if (!invariant_) return T;
    const Matrix3d& R = before.T_W_I.R;
    T.block<3, 3>(kRotation, kRotation) = after.T_W_I.R.transpose() * R;
    for (const int x : {int{kPosition}, int{kVelocity}, int{kGravity}, int{kAcceleration}})
        if (x < core_size_) T.block<3, 3>(x, kRotation) = -so3::skew(delta.segment<3>(x)) * R;
    return T;
}

void FilterState::settle() {
    if (!waiting_.any) return;
    const int c = core_size_, rest = size_ - c;
    if (rest > 0) {
        auto P_rc = P_.block(c, 0, rest, c);
        auto P_cr = P_.block(0, c, c, rest);
        VectorXd delta = VectorXd::Zero(size_);
        if (waiting_.measured) {
            delta.tail(rest).noalias() = P_rc * waiting_.vector;
            const MatrixXd A = P_rc * waiting_.information;
            P_.block(c, c, rest, rest).noalias() -= A * P_cr;
        }
        const MatrixXd moved_P_cr = waiting_.transition * P_cr;
        P_cr = moved_P_cr;
        P_rc = moved_P_cr.transpose();
        if (waiting_.measured) correct(delta);
    }
    waiting_.any = waiting_.measured = false;
    waiting_.transition.setIdentity();
    waiting_.information.setZero();
    waiting_.vector.setZero();
}

void FilterState::inflate(const CoreVector& variances) {
    P_.diagonal().head(core_size_) += variances;
}

// ---- Updates of the whole state -----------------------------------------------------------------

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

int FilterState::update(const Linearise& linearise, int max_iterations) {
    constexpr double kConverged = 0.05;  // standard deviations of a measurement
    std::vector<PointRows> rows;
    VectorXd delta = VectorXd::Zero(size_), residual, next;
    const VectorXd reading = invariant_ ? scale_reading() : VectorXd();
    const VectorXd scale_before = scale_direction(VectorXd::Zero(size_));
    VectorXd scale_change;
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
        if (iteration > 0 && reading.size() > 0)
            scale_change = scale_direction(delta) - scale_before;
        const double scale = scale_change.size() > 0 ? reading.dot(delta) : 0;
        for (std::size_t i = 0; i < rows.size(); ++i) {
            auto r = residual.segment<2>(2 * static_cast<Eigen::Index>(i));
            r = rows[i].residual + applied(rows[i], delta);
            if (scale_change.size() > 0) r += scale * applied(rows[i], scale_change);
        }
        gain(rows, scale_change, reading);
        next.noalias() = PHt_ * llt_.solve(residual);
        ++iteration;
        double change = 0;
        const VectorXd step = next - delta;
        for (const PointRows& row : rows)
            change = std::max(change, applied(row, step).lpNorm<Eigen::Infinity>());
        delta.swap(next);
        if (iteration >= max_iterations || change < kConverged) break;
    }
    reduce_covariance();
    correct(delta);
    return iteration;
}

void FilterState::update(const MatrixXd& H, const VectorXd& residual) {
    gain(H);
    const VectorXd delta = PHt_ * llt_.solve(residual);
    reduce_covariance();
    correct(delta);
}

// Moves the mean, and the covariance with it: P <- T P T^T with T of the header's head, which
// touches the rows and columns of the core and of each clone.
void FilterState::correct(const VectorXd& delta) {
    if (invariant_) {
        const VectorXd reading = scale_reading();
        if (reading.size() > 0)
            carry_scale(scale_direction(delta) - scale_direction(VectorXd::Zero(size_)), reading);
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
    const Eigen::Index n = T.rows();
    const CoreMatrix own = P_.block(at, at, n, n);
    const MatrixXd rows = T * P_.block(at, 0, n, size_);
    P_.block(at, 0, n, size_) = rows;
    P_.block(0, at, size_, n) = rows.transpose();
    const CoreMatrix moved_own = T * own * T.transpose();
    P_.block(at, at, n, n) = 0.5 * (moved_own + moved_own.transpose());
}

// ---- Which parts there are ----------------------------------------------------------------------

void FilterState::augment(const std::vector<LandmarkState>& landmarks, const MatrixXd& G,
                          const MatrixXd& noise) {
    const int added = 3 * static_cast<int>(landmarks.size());
    reserve(size_ + added);
    const MatrixXd PGt = P_.topLeftCorner(size_, G.cols()) * G.transpose();
    const MatrixXd own = G * PGt.topRows(G.cols()) + noise;
    P_.block(0, size_, size_, added) = PGt;
    P_.block(size_, 0, added, size_) = PGt.transpose();
    P_.block(size_, size_, added, added) = 0.5 * (own + own.transpose());
    landmarks_.insert(landmarks_.end(), landmarks.begin(), landmarks.end());
    size_ += added;
}

void FilterState::clone(int image_idx) {
    int slot = find_clone(-1);
    if (slot < 0) {
        slot = static_cast<int>(clones_.size());
        const int at = window_size(), behind = size_ - at;
        reserve(size_ + 6);
        const MatrixXd columns = P_.block(0, at, size_, behind);
        P_.block(0, at + 6, at, behind) = columns.topRows(at);
        P_.block(at + 6, 0, behind, at) = columns.topRows(at).transpose();
        P_.block(at + 6, at + 6, behind, behind) = columns.bottomRows(behind);
        clones_.emplace_back();
        size_ += 6;
    }
    const int at = clone_offset(slot);
    clones_[slot] = {image_idx, core_.T_W_I};
    P_.block(at, 0, 6, size_) = P_.block(0, 0, 6, size_).eval();
    P_.block(0, at, size_, 6) = P_.block(0, 0, size_, 6).eval();
}

void FilterState::release_clone(int slot) {
    clones_[slot].image_idx = -1;
}

void FilterState::reanchor(int idx, int slot, const MovedPoint& moved) {
    LandmarkState& landmark = landmarks_[idx];
    const int own = landmark_offset(idx), from = clone_offset(landmark.anchor),
              to = clone_offset(slot);
    const auto product = [&](const auto& columns_of) -> MatrixXd {
        return moved.J_point * columns_of(own, 3) + moved.J_from * columns_of(from, 6) +
               moved.J_to * columns_of(to, 6);
    };
    const MatrixXd rows = product([&](int at, int n) { return P_.block(at, 0, n, size_); });
    const Matrix3d variance =
        product([&](int at, int n) -> MatrixXd { return rows.middleCols(at, n).transpose(); });
    P_.block(own, 0, 3, size_) = rows;
    P_.block(0, own, size_, 3) = rows.transpose();
    P_.block<3, 3>(own, own) = 0.5 * (variance + variance.transpose());
    landmark.point = moved.point;
    landmark.anchor = slot;
}

void FilterState::marginalise(const std::vector<bool>& remove) {
    int to = window_size();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < landmarks_.size(); ++i) {
        if (remove[i]) continue;
        const int from = landmark_offset(static_cast<int>(i));
        if (from != to) {
            P_.block(0, to, size_, 3) = P_.block(0, from, size_, 3).eval();
            P_.block(to, 0, 3, size_) = P_.block(from, 0, 3, size_).eval();
        }
        landmarks_[kept++] = landmarks_[i];
        to += 3;
    }
    landmarks_.resize(kept);
    size_ = to;
}

}  // namespace vio
