// Updates of the whole state, and what consistency asks of them; see filter_state.h.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "libvio/geometry/so3.h"
#include "libvio/recursive/filter_state.h"
#include "libvio/recursive/transpose.h"

namespace vio {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double kConverged = 0.05;  // standard deviations of a measurement
constexpr int kRowsAtOnce = 64;      // of measurements that reduce the covariance, even

}  // namespace

Vector2d FilterState::applied(const PointRows& row, const VectorXd& d) const {
    Vector2d sum = row.J_pose * d.segment<6>(clone_offset(row.slot)) +
                   row.J_anchor * d.segment<6>(clone_offset(landmarks_[row.landmark_idx].anchor)) +
                   row.J_landmark * d.segment<3>(landmark_offset(row.landmark_idx));
    if (mount_size_ > 0) sum += row.J_camera * d.segment<6>(mount_offset());
    return sum;
}

VectorXd FilterState::applied(const std::vector<PointRows>& rows, const VectorXd& d) const {
    VectorXd result(2 * static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i)
        result.segment<2>(2 * static_cast<Eigen::Index>(i)) = applied(rows[i], d);
    return result;
}

// M J^T, two columns; where M has the window's columns alone, without the landmark's part.
void FilterState::combine(const Eigen::Ref<const MatrixXd>& M, const PointRows& row, double* first,
                          double* second) const {
    Eigen::Matrix<double, 2, 21> J;
    const double* columns[21];
    int count = 0;
    const auto add = [&](int at, const auto& own) {
        J.middleCols<std::decay_t<decltype(own)>::ColsAtCompileTime>(count) = own;
        for (int k = 0; k < own.cols(); ++k)
            columns[count++] = M.data() + (at + k) * M.outerStride();
    };
    add(clone_offset(row.slot), row.J_pose);
    add(clone_offset(landmarks_[row.landmark_idx].anchor), row.J_anchor);
    if (mount_size_ > 0) add(mount_offset(), row.J_camera);
    const int landmark = landmark_offset(row.landmark_idx);
    if (landmark < M.cols()) add(landmark, row.J_landmark);
    blas::combine(columns, J.data(), count, static_cast<int>(M.rows()), first, second);
}

// P J^T, two columns of the work space.
void FilterState::project(const PointRows& row, int column) {
    combine(P(), row, PHt_.col(column).data(), PHt_.col(column + 1).data());
}

// P H^T and S = H P H^T + I for landmarks, H = J; S stands where its factor L will.
void FilterState::gain(const std::vector<PointRows>& rows) {
    const int m = 2 * static_cast<int>(rows.size());
    PHt_.resize(size_, m);
    L_.resize(m, m);
    u_.resize(0);
    for (int i = 0; i < m / 2; ++i) project(rows[i], 2 * i);
    HP_.resize(m, size_);
    transpose(PHt_, HP_);
    for (int i = 0; i < m; i += 2)
        combine(HP_.bottomRows(m - i), rows[i / 2], &L_(i, i), &L_(i, i + 1));
    L_.diagonal().array() += 1;
}

// P H^T and the factor of S with H = J + u s^T, where s reads the scale's error. False where S is
// no covariance.
bool FilterState::change_gain(const VectorXd& u, const VectorXd& reading) {
    u_ = u;
    P_reading_ = covariance_with(reading);
    const VectorXd half = PHt_.transpose() * reading + 0.5 * reading.dot(P_reading_) * u;
    PHt_.noalias() += P_reading_ * u.transpose();
    // S grows by u half^T + half u^T, as a sum of squares with u and half alike in size.
    const double norm = u.norm(), half_norm = half.norm();
    if (norm * half_norm == 0) return true;
    const double balance = std::sqrt(half_norm / norm), root = std::sqrt(0.5);
    return blas::update_factor(L_, root * (balance * u + half / balance), 1) &&
           blas::update_factor(L_, root * (balance * u - half / balance), -1);
}

// P s, where P is whole.
VectorXd FilterState::covariance_with(const VectorXd& reading) const {
    VectorXd P_reading = VectorXd::Zero(size_);
    for (int i = landmark_offset(0) + 2; i < size_; i += 3)
        P_reading += reading(i) * P_.col(i).head(size_);
    return P_reading;
}

void FilterState::gain(const MatrixXd& H) {
    const Eigen::Index first = window_size() - H.cols();
    u_.resize(0);
    PHt_.setZero(size_, H.rows());
    blas::add_product(1, P_.block(0, first, size_, H.cols()), H, PHt_);
    L_.setIdentity(H.rows(), H.rows());
    blas::add_product(1, H, PHt_.middleRows(first, H.cols()).transpose(), L_);
}

// S^-1 residual.
VectorXd FilterState::weighted(VectorXd residual) const {
    const auto L = L_.triangularView<Eigen::Lower>();
    L.solveInPlace(residual);
    L.transpose().solveInPlace(residual);
    return residual;
}

MatrixXd FilterState::projected_covariance(const MatrixXd& H) const {
    const blas::Serial serial;
    const Eigen::Index n = H.cols(), first = window_size() - n;
    MatrixXd HP = MatrixXd::Zero(H.rows(), n), projected = MatrixXd::Zero(H.rows(), H.rows());
    blas::add_product(1, H, P_.block(first, first, n, n), HP);
    blas::add_product(1, HP, H, projected);
    return projected;
}

// P -= (P H^T) S^-1 (H P) = W W^T with W = P H^T L^-T, here and below in the lower triangle.
void FilterState::reduce_covariance() {
    blas::divide(L_, PHt_);
    blas::subtract_square(PHt_, P());
}

// The same for landmarks. A few columns of W at a time: the next are P H^T L^-T, too, with the P
// reduced so far and their own block of L. As H is sparse, that costs less than the rest of L.
void FilterState::reduce_covariance(const std::vector<PointRows>& rows, const VectorXd& reading) {
    const int m = static_cast<int>(PHt_.cols());
    for (int first = 0; first < m; first += kRowsAtOnce) {
        const int count = std::min(kRowsAtOnce, m - first);
        auto W = PHt_.middleCols(first, count);
        if (first > 0) {
            fill_upper(0, window_size());
            int from = size_, to = 0;  // they are near one another in the state, too
            for (int i = first / 2; i < (first + count) / 2; ++i) {
                from = std::min(from, landmark_offset(rows[i].landmark_idx));
                to = std::max(to, landmark_offset(rows[i].landmark_idx) + 3);
            }
            fill_upper(from, to - from);
            for (int i = first / 2; i < (first + count) / 2; ++i) project(rows[i], 2 * i);
            if (u_.size() > 0) W.noalias() += P_reading_ * u_.segment(first, count).transpose();
        }
        blas::divide(L_.block(first, first, count, count), W);
        blas::subtract_square(W, P());
        if (u_.size() > 0) P_reading_.noalias() -= W * (W.transpose() * reading).eval();
    }
}

// Upper triangle from the lower, for columns from `at` on.
void FilterState::fill_upper(int at, int count) {
    transpose(P_.block(at, 0, count, at), P_.block(0, at, at, count));
    mirror_lower(P_.block(at, at, count, count));
}

// Whether the residuals at the prior moved by delta are as those at the prior, with their rows,
// say.
bool FilterState::linear_until(const Linearise& linearise, const std::vector<PointRows>& rows,
                               const VectorXd& residual, const VectorXd& delta,
                               const VectorXd& reading) const {
    std::vector<PointRows> there;
    linearise(scaled(delta, reading), &there);
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

int FilterState::update(const Linearise& linearise, int max_iterations) {
    const blas::Serial serial;
    std::vector<PointRows> rows;
    VectorXd delta = VectorXd::Zero(size_), step = delta, residual, weight, next;
    const VectorXd reading = invariant_ ? scale_reading() : VectorXd();
    const bool sensitive = trusts_sensitivity();
    const VectorXd scale_before = scale_direction(VectorXd::Zero(size_));
    VectorXd from_noise;
    InnovationSums innovations = innovations_;
    int iteration = 0;
    while (true) {
        linearise(step, &rows);
        if (rows.empty()) return 0;
        carry_back(delta, &rows);
        residual = applied(rows, delta);
        for (std::size_t i = 0; i < rows.size(); ++i)
            residual.segment<2>(2 * static_cast<Eigen::Index>(i)) += rows[i].residual;
        gain(rows);
        if (!blas::factorize(L_)) return 0;
        if (iteration > 0 && reading.size() > 0) {
            VectorXd scale_change = scale_direction(step) - scale_before;
            if (sensitive) scale_change += from_noise;
            if (!change_gain(applied(rows, scale_change), reading)) return 0;
            residual += reading.dot(delta) * u_;
        }
        weight = weighted(residual);
        if (iteration == 0) innovations.add(residual, residual.dot(weight));
        next.noalias() = PHt_ * weight;
        if (sensitive) from_noise = sensitivity_change(rows, weight);
        ++iteration;
        if (iteration == 1 && max_iterations > 1 &&
            linear_until(linearise, rows, residual, next, reading)) {
            // The rows are good as they are, but for the scale's sensitivity.
            if (sensitive && reading.size() > 0) {
                if (!change_gain(applied(rows, from_noise), reading)) return 0;
                weight = weighted(residual + reading.dot(next) * u_);
                next.noalias() = PHt_ * weight;
                from_noise = sensitivity_change(rows, weight);
            }
            delta.swap(next);
            step = scaled(delta, reading);
            break;
        }
        const double change = applied(rows, next - delta).lpNorm<Eigen::Infinity>();
        delta.swap(next);
        step = scaled(delta, reading);
        if (iteration >= max_iterations || change < kConverged) break;
    }
    innovations_ = innovations;
    if (sensitive) take_out_noise(rows);
    bool doubtful = sensitive && reading.size() > 0 && in_variables_->has_landmarks();
    const ToldOfScale told = doubtful ? told_of_scale(rows, reading) : ToldOfScale();
    if (told.noise && *told.noise < 0) {
        // What cannot be: corrections were too large for the first order of C.
        in_variables_->forget();
        doubtful = false;
    }
    reduce_covariance(rows, reading);
    update_sensitivity(rows, sensitive);
    if (doubtful) {
        innovations_.scale = std::max(innovations_.scale, told.sigmas(reading.dot(delta)));
        doubt_scale(told, reading, &delta);
        step = scaled(delta, reading);
    }
    correct(step, from_noise);
    return iteration;
}

// Jacobians with respect to the errors at the prior, from those at the prior moved by delta.
void FilterState::carry_back(const VectorXd& delta, std::vector<PointRows>* rows) const {
    std::vector<Matrix6d> clone;
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i)
        clone.push_back(pose_carrier(delta.segment<6>(clone_offset(i)), clones_[i].T_W_I.R));
    for (PointRows& row : *rows) {
        row.J_pose = (row.J_pose * clone[row.slot]).eval();
        row.J_anchor = (row.J_anchor * clone[landmarks_[row.landmark_idx].anchor]).eval();
    }
}

// M H^T; M has a column for each of the state's errors, or for the first of them: the window's.
MatrixXd FilterState::times_transpose(const Eigen::Ref<const MatrixXd>& M,
                                      const std::vector<PointRows>& rows) const {
    MatrixXd product(M.rows(), 2 * static_cast<Eigen::Index>(rows.size()));
    for (int i = 0; i < static_cast<int>(rows.size()); ++i)
        combine(M, rows[i], &product(0, 2 * i), &product(0, 2 * i + 1));
    return product;
}

// The first entries of H^T w.
VectorXd FilterState::transposed_times(const std::vector<PointRows>& rows, const VectorXd& w,
                                       Eigen::Index size) const {
    VectorXd product = VectorXd::Zero(size_);
    for (int i = 0; i < static_cast<int>(rows.size()); ++i) {
        const PointRows& row = rows[i];
        const Vector2d own = w.segment<2>(2 * i);
        product.segment<6>(clone_offset(row.slot)) += row.J_pose.transpose() * own;
        product.segment<6>(clone_offset(landmarks_[row.landmark_idx].anchor)) +=
            row.J_anchor.transpose() * own;
        if (mount_size_ > 0) product.segment<6>(mount_offset()) += row.J_camera.transpose() * own;
        product.segment<3>(landmark_offset(row.landmark_idx)) += row.J_landmark.transpose() * own;
    }
    return product.head(size);
}

VectorXd FilterState::transposed_times(const MatrixXd& H, const VectorXd& w,
                                       Eigen::Index size) const {
    VectorXd product = VectorXd::Zero(size);
    product.segment(window_size() - H.cols(), H.cols()) = H.transpose() * w;
    return product;
}

// H: for the last errors of the window.
MatrixXd FilterState::times_transpose(const Eigen::Ref<const MatrixXd>& M,
                                      const MatrixXd& H) const {
    MatrixXd product = MatrixXd::Zero(M.rows(), H.rows());
    blas::add_product(1, M.middleCols(window_size() - H.cols(), H.cols()), H, product);
    return product;
}

void FilterState::update(const MatrixXd& H, const VectorXd& residual) {
    const blas::Serial serial;
    const bool sensitive = trusts_sensitivity();
    gain(H);
    if (!blas::factorize(L_)) return;
    const VectorXd weight = weighted(residual);
    innovations_.add(residual, residual.dot(weight));
    const VectorXd delta = scaled(PHt_ * weight, scale_reading());
    VectorXd from_noise;
    if (sensitive) {
        from_noise = sensitivity_change(H, weight);
        take_out_noise(H);
    }
    reduce_covariance();
    update_sensitivity(H, sensitive);
    correct(delta, from_noise);
}

// What an innovation, weighted by S^-1, changes in the errors' sensitivity to scale; see
// errors_in_variables.h.
template <typename Rows>
VectorXd FilterState::sensitivity_change(const Rows& H, const VectorXd& weight) const {
    const MatrixXd& C = in_variables_->correlation();
    VectorXd change = VectorXd::Zero(size_);
    change.head(C.rows()).noalias() = -C * transposed_times(H, weight, C.cols());
    return change;
}

template <typename Rows>
void FilterState::take_out_noise(const Rows& H) {
    in_variables_->take_out([&](const blas::ConstMatrix& M) { return times_transpose(M, H); }, L_);
}

// The correction's variance is what it takes off s^2.
double FilterState::ToldOfScale::sigmas(double correction) const {
    if (!(information > 0)) return 0;
    return std::abs(correction) /
           (variance * std::sqrt(information / (1 + variance * information)));
}

// Before the covariance is reduced.
FilterState::ToldOfScale FilterState::told_of_scale(const std::vector<PointRows>& rows,
                                                    const VectorXd& reading) const {
    constexpr double kLeast = 1e-9;
    const VectorXd P_reading = u_.size() > 0 ? P_reading_ : covariance_with(reading);
    const double variance = reading.dot(P_reading);
    VectorXd h = applied(rows, P_reading / variance);
    if (u_.size() > 0) h += u_;
    L_.triangularView<Eigen::Lower>().solveInPlace(h);
    const double left = std::max(kLeast, 1 - variance * h.squaredNorm());  // 1 / (1 + s^2 I)
    const double information = h.squaredNorm() / left;
    if (!in_variables_->noise_due()) return {variance, information, std::nullopt};

    const MatrixXd& V = in_variables_->noise();
    MatrixXd Ht = MatrixXd::Zero(V.rows(), L_.rows());  // L^-T
    for (int i = 0; i < static_cast<int>(rows.size()); ++i) {
        const PointRows& row = rows[i];
        auto own = Ht.middleCols<2>(2 * i);
        own.middleRows<6>(clone_offset(row.slot)) = row.J_pose.transpose();
        own.middleRows<6>(clone_offset(landmarks_[row.landmark_idx].anchor)) +=
            row.J_anchor.transpose();
        if (mount_size_ > 0) own.middleRows<6>(mount_offset()) = row.J_camera.transpose();
    }
    blas::divide(L_, Ht);
    const VectorXd weighted_h = Ht * h;
    MatrixXd minus = MatrixXd::Zero(V.rows(), V.rows());  // H^T S^-1 H
    blas::subtract_square(Ht, minus);
    minus.diagonal() /= 2;
    double noise = -2 * V.cwiseProduct(minus).sum();
    noise += variance / left * weighted_h.dot(V * weighted_h);  // S^-1 to S0^-1
    return {variance, information, noise};
}

// After the covariance has been reduced; delta: the correction.
void FilterState::doubt_scale(const ToldOfScale& told, const VectorXd& reading, VectorXd* delta) {
    const double x = in_variables_->share_of_motion(told.information, told.noise),
                 taken = 1 + told.variance * told.information,
                 meant = 1 + told.variance * x * x * told.information;
    VectorXd g = u_.size() > 0 ? P_reading_ : blas::symmetric_times(P(), reading);
    const double variance = reading.dot(g);
    g /= variance;
    blas::add_square(variance * (taken / meant - 1), g, P());
    *delta -= (1 - x * taken / meant) * reading.dot(*delta) * g;
}

// For the update that the covariance has just been reduced by: as its noise is a unit, its gain is
// P H^T with the P that it left. Not trusted: nothing of it is kept.
template <typename Rows>
void FilterState::update_sensitivity(const Rows& H, bool trusted) {
    if (!in_variables_) return;
    if (!trusted) return in_variables_->forget();
    const int n = in_variables_->size();
    transpose(P_.block(n, 0, size_ - n, n), P_.block(0, n, n, size_ - n));
    mirror_lower(P_.topLeftCorner(n, n));
    MatrixXd gain = times_transpose(P_.topLeftCorner(n, size_), H);
    if (u_.size() > 0) gain.noalias() += P_reading_.head(n) * u_.transpose();
    in_variables_->update(
        gain, [&](const blas::ConstMatrix& M) { return times_transpose(M, H); }, scale());
}

// Moves the mean, and the covariance with it, of which the lower triangle is read: P <- T P T^T
// with T of the header's head, which touches the rows and columns of the core and of each clone.
void FilterState::correct(const VectorXd& delta, const VectorXd& from_noise) {
    if (invariant_) {
        const VectorXd reading = scale_reading();
        if (reading.size() > 0) {
            VectorXd change = scale_direction(delta) - scale_direction(VectorXd::Zero(size_));
            if (from_noise.size() > 0) change += from_noise;
            carry_scale(change, reading);
        }
    }
    if (invariant_) fill_upper(0, window_size());
    const CoreState before = core_;
    core_ = moved(core_, delta.head(core_size_));
    if (invariant_) carry(0, core_carrier(delta.head(core_size_), before, core_).leftCols<3>());
    mount_.T_I_C = T_I_C(delta);
    if (mount_size_ > 0) mount_.time_offset += delta(mount_offset() + kTimeOffset);
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        const Vector6d own = delta.segment<6>(clone_offset(i));
        if (invariant_) carry(clone_offset(i), pose_carrier(own, clones_[i].T_W_I.R).leftCols<3>());
        clones_[i].T_W_I = clones_[i].T_W_I.boxplus(own);
    }
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i)
        landmarks_[i].point.x += delta.segment<3>(landmark_offset(i));
    fill_upper(0, size_);
}

// Direction of scale at the mean moved by delta; see the header's head.
VectorXd FilterState::scale_direction(const VectorXd& delta) const {
    VectorXd n = VectorXd::Zero(size_);
    n.segment<3>(kPosition) = core_.T_W_I.p + delta.segment<3>(kPosition);
    if (core_size_ > kVelocity) n.segment<3>(kVelocity) = core_.v_W + delta.segment<3>(kVelocity);
    if (core_size_ > kAcceleration)
        n.segment<3>(kAcceleration) = core_.a_W + delta.segment<3>(kAcceleration);
    for (int i = 0; i < static_cast<int>(clones_.size()); ++i) {
        const int at = clone_offset(i) + kPosition;
        n.segment<3>(at) = clones_[i].T_W_I.p + delta.segment<3>(at);
    }
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i) {
        const int at = landmark_offset(i) + 2;
        n(at) = -(landmarks_[i].point.x.z() + delta(at));
    }
    return n;
}

// A correction of the mean: where the errors delta make all that is travelled (1 + a) times as
// long, inverse distances become 1 / (1 + a) times what they were, not 1 - a times. Images do not
// see the difference, a^2 of the scale: adding delta as it is would leave later motion too large
// beside what is behind.
VectorXd FilterState::scaled(VectorXd delta, const VectorXd& reading) const {
    if (!invariant_ || reading.size() == 0) return delta;
    constexpr double kLeast = -0.5;
    const double a = std::max(kLeast, reading.dot(delta)), beyond = a * a / (1 + a);
    for (int i = 0; i < static_cast<int>(landmarks_.size()); ++i)
        delta(landmark_offset(i) + 2) += beyond * landmarks_[i].point.x.z();
    return delta;
}

ErrorsInVariables::Scale FilterState::scale() const {
    return {scale_direction(VectorXd::Zero(size_)), scale_reading()};
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
    const VectorXd P_reading = blas::symmetric_times(P(), reading);
    const VectorXd half = P_reading + 0.5 * reading.dot(P_reading) * change;
    blas::add_pair(half, change, P());
}

// The errors from `at` on, of core or clones, become T times what they were: in the columns of the
// window, hence in the lower triangle.
void FilterState::carry(int at, const Carrier& T) {
    const Eigen::Index n = T.rows();
    carry_columns(P_.block(0, at, size_, n), T);
    carry_rows(P_.block(at, 0, n, window_size()), T);
    if (in_variables_) in_variables_->carry(at, T);
}

}  // namespace vio
