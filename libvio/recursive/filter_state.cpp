#include "libvio/recursive/filter_state.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "libvio/geometry/so3.h"
#include "libvio/recursive/body_frame.h"
#include "libvio/recursive/transpose.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr std::size_t kFewLandmarks = 64;  // see errors_in_variables.h

}  // namespace

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
    if (kind == CoreKind::inertial && invariant) in_variables_.emplace();
}

void FilterState::start_mount(const CameraMount& mount, const MatrixXd& covariance) {
    mount_ = mount;
    if (covariance.size() == 0) return;
    mount_size_ = kMountSize;
    reserve(size_ + kMountSize);
    P_.block(0, size_, size_, kMountSize).setZero();
    P_.block(size_, 0, kMountSize, size_).setZero();
    P_.block<kMountSize, kMountSize>(size_, size_) = covariance;
    size_ += kMountSize;
    if (in_variables_) in_variables_->add_exact(kMountSize);
}

CoreMatrix FilterState::timed_covariance() const {
    const int c = core_size_, at = mount_offset() + kTimeOffset;
    CoreMatrix P(c + 1, c + 1);
    P.topLeftCorner(c, c) = core_covariance();
    P.topRightCorner(c, 1) = waiting_.transition * P_.block(0, at, c, 1);
    P.bottomLeftCorner(1, c) = P.topRightCorner(c, 1).transpose();
    P(c, c) = P_(at, at);
    return P;
}

void FilterState::start_landmarks(const std::vector<LandmarkState>& landmarks,
                                  const MatrixXd& joint_covariance) {
    landmarks_ = landmarks;
    const int size = window_size() + 3 * static_cast<int>(landmarks.size());
    reserve(size);
    size_ = size;
    P() = joint_covariance;
    if (in_variables_)
        in_variables_->augment(0,
                               MatrixXd::Zero(3 * static_cast<Eigen::Index>(landmarks.size()), 0));
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

// How far a correction moves the accelerometer's bias so that the specific force at rest,
// bias - R^T g, stays: 1 along the directions that hardly anything but turning tells apart.
double FilterState::bias_follows_attitude(const CoreState& core,
                                          const Eigen::Ref<const VectorXd>& delta) {
    const Vector3d following =
        (core.T_W_I.R.transpose() * core.g_W).cross(delta.segment<3>(kRotation));
    const double norm2 = following.squaredNorm();
    if (!(norm2 > 0)) return 0;
    return std::clamp(following.dot(delta.segment<3>(kAccelBias)) / norm2, 0.0, 1.0);
}

CoreState FilterState::moved(const CoreState& core, const Eigen::Ref<const VectorXd>& delta) {
    CoreState x = core;
    x.T_W_I = core.T_W_I.boxplus(delta.head<6>());
    if (delta.size() < static_cast<int>(CoreKind::inertial)) return x;
    x.v_W += delta.segment<3>(kVelocity);
    x.gyro_bias += delta.segment<3>(kGyroBias);
    x.accel_bias += delta.segment<3>(kAccelBias);
    if (delta.size() < static_cast<int>(CoreKind::smooth)) {
        const Vector3d g_I = core.T_W_I.R.transpose() * core.g_W, theta = delta.head<3>();
        x.accel_bias +=
            bias_follows_attitude(core, delta) * (so3::exp(-theta) * g_I - g_I + theta.cross(g_I));
        return x;
    }
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
    if (in_variables_) in_variables_->propagate(transition, noise, P_cc);
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
        const CoreResidual weighted = llt.solve(residual);
        if (i == 0) innovations_.add(residual, residual.dot(weighted));
        delta = PHt * weighted;
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
    const CoreMatrix change = carrier * reduction;
    if (in_variables_) in_variables_->update_core(change);
    waiting_.transition = (change * waiting_.transition).eval();
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
    if (core_size_ == static_cast<int>(CoreKind::inertial))
        T.block<3, 3>(kAccelBias, kRotation) =
            bias_follows_attitude(before, delta) *
            (so3::skew(after.T_W_I.R.transpose() * before.g_W) * T.topLeftCorner<3, 3>() -
             so3::skew(R.transpose() * before.g_W));
    return T;
}

// Errors of a pose at the prior moved by delta, from those at the prior; see the header's head.
Matrix6d FilterState::pose_carrier(const Vector6d& delta, const Matrix3d& R_before) const {
    Matrix6d T = Matrix6d::Identity();
    if (!invariant_) return T;
    T.topLeftCorner<3, 3>() = so3::exp(-delta.head<3>());
    T.bottomLeftCorner<3, 3>() = -so3::skew(delta.tail<3>()) * R_before;
    return T;
}

void FilterState::settle() {
    if (!waiting_.any) return;
    const blas::Serial serial;
    const int c = core_size_, rest = size_ - c;
    if (in_variables_) in_variables_->settle(P_.block(c, 0, in_variables_->size() - c, c));
    if (rest > 0) {
        auto P_rc = P_.block(c, 0, rest, c);
        auto P_cr = P_.block(0, c, c, rest);
        VectorXd delta = VectorXd::Zero(size_);
        if (waiting_.measured) {
            delta.tail(rest).noalias() = P_rc * waiting_.vector;
            const MatrixXd A = P_rc * waiting_.information;
            P_.block(c, c, rest, rest).noalias() -= A * P_cr;
        }
        MatrixXd moved_P_rc = MatrixXd::Zero(rest, c);
        blas::add_product(1, P_rc, waiting_.transition, moved_P_rc);
        P_rc = moved_P_rc;
        transpose(moved_P_rc, P_cr);
        if (waiting_.measured) correct(scaled(delta, scale_reading()));
    }
    waiting_.any = waiting_.measured = false;
    waiting_.transition.setIdentity();
    waiting_.information.setZero();
    waiting_.vector.setZero();
}

void FilterState::inflate(int slot, double rotation, double position, double velocity) {
    const int clone = clone_offset(slot);
    for (const int row : {0, clone})
        for (const int column : {0, clone}) {
            P_.block<3, 3>(row + kRotation, column + kRotation).diagonal().array() +=
                rotation * rotation;
            P_.block<3, 3>(row + kPosition, column + kPosition).diagonal().array() +=
                position * position;
        }
    if (core_size_ > kVelocity) P_.diagonal().segment<3>(kVelocity).array() += velocity * velocity;
}

// errors_in_variables.h is of first order: after a while without images, corrections of velocity
// are too large for it.
bool FilterState::trusts_sensitivity() const {
    constexpr double kKnown = 0.05, kShare = 0.025;  // [m/s], of the speed
    return in_variables_ && velocity_sigma(core_.T_W_I.R, core_.v_W, core_covariance()) <=
                                std::max(kKnown, kShare * core_.v_W.norm());
}

// ---- Which parts there are ----------------------------------------------------------------------

void FilterState::augment(const std::vector<LandmarkState>& landmarks, const MatrixXd& G,
                          const MatrixXd& noise) {
    const int added = 3 * static_cast<int>(landmarks.size());
    // With the first landmarks scale begins anew: what was read before them says nothing of theirs.
    if (landmarks_.empty() && in_variables_) in_variables_->forget();
    const blas::Serial serial;
    reserve(size_ + added);
    const Eigen::Index first = window_size() - G.cols();
    MatrixXd PGt = MatrixXd::Zero(size_, added);
    blas::add_product(1, P_.block(0, first, size_, G.cols()), G, PGt);
    const MatrixXd own = G * PGt.middleRows(first, G.cols()) + noise;
    const bool few = in_variables_ && in_variables_->size() == size_ &&
                     landmarks_.size() + landmarks.size() <= kFewLandmarks;
    if (few)
        in_variables_->augment(static_cast<int>(first), G);
    else if (in_variables_)
        in_variables_->truncate(window_size());
    P_.block(0, size_, size_, added) = PGt;
    P_.block(size_, 0, added, size_) = PGt.transpose();
    P_.block(size_, size_, added, added) = 0.5 * (own + own.transpose());
    landmarks_.insert(landmarks_.end(), landmarks.begin(), landmarks.end());
    size_ += added;
    if (few) in_variables_->read_scale_anew(static_cast<int>(first), G, scale());
}

void FilterState::clone(int image_idx, const Vector6d& pose_rate, double shift) {
    int slot = find_clone(-1);
    const bool inserted = slot < 0;
    if (inserted) {
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
    clones_[slot] = {image_idx, core_.T_W_I.boxplus(shift * pose_rate)};
    P_.block(at, 0, 6, size_) = P_.block(0, 0, 6, size_).eval();
    P_.block(0, at, size_, 6) = P_.block(0, 0, size_, 6).eval();
    if (in_variables_) in_variables_->clone(at, inserted);
    if (mount_size_ == 0) return;
    const int offset = mount_offset() + kTimeOffset;
    P_.block(at, 0, 6, size_) += pose_rate * P_.row(offset).head(size_);
    P_.block(0, at, size_, 6) += P_.col(offset).head(size_) * pose_rate.transpose();
    if (in_variables_) in_variables_->add(at, offset, pose_rate);
}

void FilterState::release_clone(int slot) {
    clones_[slot].image_idx = -1;
}

void FilterState::reanchor(int idx, int slot, const MovedPoint& moved) {
    LandmarkState& landmark = landmarks_[idx];
    const int own = landmark_offset(idx), from = clone_offset(landmark.anchor),
              to = clone_offset(slot), mounted = mount_size_ > 0 ? 6 : 0;
    MatrixXd columns = P_.block(0, own, size_, 3).lazyProduct(moved.J_point.transpose());
    columns += P_.block(0, from, size_, 6).lazyProduct(moved.J_from.transpose());
    columns += P_.block(0, to, size_, 6).lazyProduct(moved.J_to.transpose());
    columns += P_.block(0, mount_offset(), size_, mounted)
                   .lazyProduct(moved.J_camera.leftCols(mounted).transpose());
    const Matrix3d variance =
        moved.J_point * columns.middleRows<3>(own) + moved.J_from * columns.middleRows<6>(from) +
        moved.J_to * columns.middleRows<6>(to) +
        moved.J_camera.leftCols(mounted) * columns.middleRows(mount_offset(), mounted);
    P_.block(0, own, size_, 3) = columns;
    transpose(columns, P_.block(own, 0, 3, size_));
    P_.block<3, 3>(own, own) = 0.5 * (variance + variance.transpose());
    if (in_variables_ && own < in_variables_->size())
        in_variables_->reanchor(own, from, to, mount_offset(), mounted, moved);
    landmark.point = moved.point;
    landmark.anchor = slot;
}

void FilterState::marginalise(const std::vector<bool>& remove) {
    if (std::find(remove.begin(), remove.end(), true) == remove.end()) return;
    const int keep = window_size();  // rows and columns before the landmarks
    std::vector<int> from;           // of the landmarks that stay
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i)
        if (!remove[i]) from.push_back(landmark_offset(i));
    for (int to = 0; to < keep + 3 * static_cast<int>(from.size()); ++to) {
        const int column = to < keep ? to : from[(to - keep) / 3] + (to - keep) % 3;
        if (column != to) P_.col(to).head(keep) = P_.col(column).head(keep);
        for (int i = 0; i < static_cast<int>(from.size()); ++i)
            P_.col(to).segment<3>(keep + 3 * i) = P_.col(column).segment<3>(from[i]);
    }
    if (in_variables_ && in_variables_->size() == size_) {
        std::vector<int> errors(static_cast<std::size_t>(keep));
        std::iota(errors.begin(), errors.end(), 0);
        for (const int at : from) errors.insert(errors.end(), {at, at + 1, at + 2});
        in_variables_->choose(errors);
    }
    std::size_t kept = 0;
    for (std::size_t i = 0; i < landmarks_.size(); ++i)
        if (!remove[i]) landmarks_[kept++] = landmarks_[i];
    landmarks_.resize(kept);
    size_ = keep + 3 * static_cast<int>(kept);
}

}  // namespace vio
