#include "libvio/recursive/filter_state.h"

#include <algorithm>
#include <cmath>

#include "libvio/geometry/so3.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
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
    const int size = core_size_ + 3 * static_cast<int>(landmarks.size());
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

// P H^T and S = H P H^T + I for landmarks seen from the core pose: nine columns per pair of rows.
void FilterState::gain(const std::vector<PointRows>& rows) {
    const int m = 2 * static_cast<int>(rows.size());
    PHt_.resize(size_, m);
    S_.resize(m, m);
    Eigen::Matrix<double, 9, 2> Jt;
    for (int i = 0; i < m / 2; ++i) {
        const PointRows& row = rows[i];
        auto columns = PHt_.middleCols<2>(2 * i);
        Jt << row.J_rotation.transpose(), row.J_position.transpose(), row.J_landmark.transpose();
        columns.noalias() = P_.topLeftCorner(size_, 6).lazyProduct(Jt.topRows<6>());
        columns.noalias() += P_.block(0, landmark_offset(row.landmark_idx), size_, 3)
                                 .lazyProduct(Jt.bottomRows<3>());
    }
    for (int i = 0; i < m / 2; ++i) {
        const PointRows& row = rows[i];
        const int offset = landmark_offset(row.landmark_idx);
        auto S_row = S_.block(2 * i, 0, 2, 2 * i + 2);
        S_row.noalias() = row.J_rotation.lazyProduct(PHt_.block(kRotation, 0, 3, 2 * i + 2));
        S_row.noalias() += row.J_position.lazyProduct(PHt_.block(kPosition, 0, 3, 2 * i + 2));
        S_row.noalias() += row.J_landmark.lazyProduct(PHt_.block(offset, 0, 3, 2 * i + 2));
    }
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

int FilterState::update(const Linearise& linearise, int max_iterations) {
    constexpr double kConverged = 0.05;  // standard deviations of a measurement
    std::vector<PointRows> rows;
    VectorXd delta = VectorXd::Zero(size_), residual, next;
    const Matrix3d R = core_.T_W_I.R;
    int iteration = 0;
    while (true) {
        linearise(delta, &rows);
        if (rows.empty()) return 0;
        residual.resize(2 * static_cast<Eigen::Index>(rows.size()));
        // Errors at this iterate are those at the prior, carried over.
        const Matrix3d dR = so3::exp(delta.head<3>()).transpose();
        const Vector3d dp = delta.segment<3>(kPosition);
        for (std::size_t i = 0; i < rows.size(); ++i) {
            PointRows& row = rows[i];
            const Vector3d dl = delta.segment<3>(landmark_offset(row.landmark_idx));
            if (invariant_ && iteration > 0)
                row.J_rotation = row.J_rotation * dR - row.J_position * so3::skew(dp) * R -
                                 row.J_landmark * so3::skew(dl) * R;
            residual.segment<2>(2 * static_cast<Eigen::Index>(i)) =
                row.residual + row.J_rotation * delta.head<3>() + row.J_position * dp +
                row.J_landmark * dl;
        }
        gain(rows);
        next.noalias() = PHt_ * llt_.solve(residual);
        ++iteration;
        double change = 0;
        for (const PointRows& row : rows) {
            const int l = landmark_offset(row.landmark_idx);
            const Eigen::Vector2d d = row.J_rotation * (next - delta).head<3>() +
                                      row.J_position * (next - delta).segment<3>(kPosition) +
                                      row.J_landmark * (next - delta).segment<3>(l);
            change = std::max(change, d.lpNorm<Eigen::Infinity>());
        }
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

// Moves the mean, and the covariance with it.
void FilterState::correct(const VectorXd& delta) {
    const Matrix3d R_before = core_.T_W_I.R;
    std::vector<Matrix3d> clone_R_before;
    clone_R_before.reserve(clones_.size());
    core_ = moved(core_, delta.head(core_size_));
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        clone_R_before.push_back(clones_[i].T_W_I.R);
        clones_[i].T_W_I = clones_[i].T_W_I.boxplus(delta.segment<6>(clone_offset(i)));
    }
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i)
        landmarks_[i].p_W += delta.segment<3>(landmark_offset(i));
    if (invariant_) carry_covariance(delta, R_before, clone_R_before);
}

// P <- T P T^T with T of the header's head: a product of rank 3 for all that goes with the core's
// rotation, and 6 x 6 blocks for the clones.
void FilterState::carry_covariance(const VectorXd& delta, const Matrix3d& R_before,
                                   const std::vector<Matrix3d>& clone_R_before) {
    auto P_now = P();
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        const int at = clone_offset(i);
        Matrix6d T = Matrix6d::Identity();
        T.topLeftCorner<3, 3>() = clones_[i].T_W_I.R.transpose() * clone_R_before[i];
        T.bottomLeftCorner<3, 3>() = -so3::skew(delta.segment<3>(at + 3)) * clone_R_before[i];
        const Eigen::Matrix<double, Eigen::Dynamic, 6> columns =
            P_now.middleCols<6>(at) * T.transpose();
        P_now.middleCols<6>(at) = columns;
        const Matrix6d own = T * columns.middleRows<6>(at);
        P_now.middleRows<6>(at) = columns.transpose();
        P_now.block<6, 6>(at, at) = 0.5 * (own + own.transpose());
    }

    // T = I + U E^T, E picking the core's rotation: P + A U^T + U A^T with A = P E + U P_rr / 2.
    Eigen::Matrix<double, Eigen::Dynamic, 6> left(size_, 6), right(size_, 6);
    auto U = left.leftCols<3>();
    U.setZero();
    U.topRows(core_size_) = [&] {
        CoreState before;
        before.T_W_I.R = R_before;
        CoreMatrix T = core_carrier(delta.head(core_size_), before, core_);
        T.diagonal().array() -= 1;
        return T.leftCols<3>().eval();
    }();
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i) {
        const int at = landmark_offset(i);
        U.middleRows<3>(at) = -so3::skew(delta.segment<3>(at)) * R_before;
    }
    auto A = left.rightCols<3>();
    A = P_now.leftCols<3>();
    const Matrix3d P_rr = P_now.topLeftCorner<3, 3>();
    A += 0.5 * U * P_rr;
    right << A, U;
    for (int j = 0; j < size_; ++j) {  // lower triangle, then mirrored
        const Eigen::Matrix<double, 6, 1> weights = right.row(j);
        P_now.col(j).tail(size_ - j).noalias() += left.bottomRows(size_ - j) * weights;
    }
    P_now.triangularView<Eigen::StrictlyUpper>() = P_now.transpose();
}

// ---- Which parts there are
// ------------------------------------------------------------------------

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
