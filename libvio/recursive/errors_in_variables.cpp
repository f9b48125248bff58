#include "libvio/recursive/errors_in_variables.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "libvio/recursive/transpose.h"

namespace vio {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kSize = static_cast<int>(CoreKind::inertial);
constexpr double kUpdates = 20;  // over which the share of motion is taken

}  // namespace

ErrorsInVariables::ErrorsInVariables()
    : C_(MatrixXd::Zero(kSize, kSize)),
      V_(MatrixXd::Zero(kSize, kSize)),
      transition_(CoreMatrix::Identity(kSize, kSize)),
      coupling_(CoreMatrix::Zero(kSize, kSize)) {}

void ErrorsInVariables::forget() {
    C_.setZero();
    V_.setZero();
    information_ = noise_ = latest_noise_ = 0;
    updates_ = 0;
}

void ErrorsInVariables::propagate(const CoreMatrix& transition, const CoreMatrix& noise,
                                  const CoreMatrix& P) {
    // What was read is a change of position and velocity. Its errors: those of attitude and biases,
    // and the readings' noise.
    CoreMatrix M = transition;
    M.middleRows<3>(kRotation).setZero();
    M.bottomRows(kSize - kGyroBias).setZero();
    M.middleCols<6>(kPosition).setZero();
    const auto Mt = M.middleRows<6>(kPosition).transpose();
    auto C = C_.topLeftCorner(kSize, kSize), V = V_.topLeftCorner(kSize, kSize);
    CoreMatrix TC = transition * C, TV = transition * V;
    TC.middleRows<6>(kPosition) += Mt.transpose() * P;
    TV.middleRows<6>(kPosition) += Mt.transpose() * C.transpose();
    C = TC * transition.transpose();
    C.middleRows<6>(kPosition) += noise.middleRows<6>(kPosition);
    V = TV * transition.transpose();
    V.middleCols<6>(kPosition) += TC * Mt;
    V.block<6, 6>(kPosition, kPosition) += noise.block<6, 6>(kPosition, kPosition);
    coupling_ = (transition * coupling_ + M * transition_).eval();
    transition_ = (transition * transition_).eval();
}

void ErrorsInVariables::update_core(const CoreMatrix& reduction) {
    for (MatrixXd* A : {&C_, &V_}) {
        auto own = A->topLeftCorner(kSize, kSize);
        own = (reduction * own * reduction.transpose()).eval();
    }
    coupling_ = (reduction * coupling_).eval();
    transition_ = (reduction * transition_).eval();
}

void ErrorsInVariables::settle(const blas::ConstMatrix& P) {
    const Eigen::Index rest = C_.rows() - kSize;
    auto C_cr = C_.topRightCorner(kSize, rest);
    auto C_rc = C_.bottomLeftCorner(rest, kSize);
    const Eigen::Index clones = V_.rows() - kSize;
    const MatrixXd V_cr = transition_ * V_.topRightCorner(kSize, clones) +
                          coupling_ * C_rc.topRows(clones).transpose();
    V_.topRightCorner(kSize, clones) = V_cr;
    V_.bottomLeftCorner(clones, kSize) = V_cr.transpose();
    MatrixXd before = C_rc, after = MatrixXd::Zero(rest, kSize);
    blas::add_product(1, before, transition_, after);
    C_rc = after;
    transpose(C_cr, before);
    after.setZero();
    blas::add_product(1, before, transition_, after);
    blas::add_product(1, P, coupling_, after);
    transpose(after, C_cr);
    transition_.setIdentity();
    coupling_.setZero();
}

void ErrorsInVariables::clone(int at, bool inserted) {
    if (inserted) {
        std::vector<int> errors(static_cast<std::size_t>(C_.rows()) + 6);
        std::iota(errors.begin(), errors.begin() + at, 0);
        std::iota(errors.begin() + at, errors.begin() + at + 6, 0);
        std::iota(errors.begin() + at + 6, errors.end(), at);
        choose(errors);
        return;
    }
    for (MatrixXd* A : {&C_, &V_}) {
        A->middleRows<6>(at) = A->topRows<6>().eval();
        A->middleCols<6>(at) = A->leftCols<6>().eval();
    }
}

void ErrorsInVariables::choose(const std::vector<int>& errors) {
    C_ = C_(errors, errors).eval();
    std::vector<int> window;
    std::copy_if(errors.begin(), errors.end(), std::back_inserter(window),
                 [&](int at) { return at < V_.rows(); });
    V_ = V_(window, window).eval();
}

void ErrorsInVariables::add_exact(int count) {
    augment(0, MatrixXd::Zero(count, 0));
    const Eigen::Index n = V_.rows();
    V_.conservativeResize(n + count, n + count);
    V_.rightCols(count).setZero();
    V_.bottomRows(count).setZero();
}

void ErrorsInVariables::augment(int first, const MatrixXd& G) {
    const Eigen::Index n = C_.rows(), added = G.rows();
    MatrixXd rows_transposed(n, G.cols()), own_transposed = MatrixXd::Zero(n, added);
    transpose(C_.middleRows(first, G.cols()), rows_transposed);
    blas::add_product(1, rows_transposed, G, own_transposed);
    C_.conservativeResize(n + added, n + added);
    transpose(own_transposed, C_.bottomLeftCorner(added, n));
    C_.rightCols(added).setZero();
    blas::add_product(1, C_.middleCols(first, G.cols()), G, C_.rightCols(added));
}

void ErrorsInVariables::add(int at, int by, const Vector6d& rate) {
    for (MatrixXd* A : {&C_, &V_}) {
        A->middleRows<6>(at) += rate * A->row(by);
        A->middleCols<6>(at) += A->col(by) * rate.transpose();
    }
}

void ErrorsInVariables::reanchor(int at, int from, int to, int mount, int mounted,
                                 const MovedPoint& J) {
    const auto J_camera = J.J_camera.leftCols(mounted);
    const MatrixXd rows = J.J_point.lazyProduct(C_.middleRows<3>(at)) +
                          J.J_from.lazyProduct(C_.middleRows<6>(from)) +
                          J.J_to.lazyProduct(C_.middleRows<6>(to)) +
                          J_camera.lazyProduct(C_.middleRows(mount, mounted));
    C_.middleRows<3>(at) = rows;
    const MatrixXd columns = C_.middleCols<3>(at).lazyProduct(J.J_point.transpose()) +
                             C_.middleCols<6>(from).lazyProduct(J.J_from.transpose()) +
                             C_.middleCols<6>(to).lazyProduct(J.J_to.transpose()) +
                             C_.middleCols(mount, mounted).lazyProduct(J_camera.transpose());
    C_.middleCols<3>(at) = columns;
}

void ErrorsInVariables::carry(int at, const Carrier& T) {
    for (MatrixXd* A : {&C_, &V_}) {
        carry_columns(A->middleCols(at, T.rows()), T);
        carry_rows(A->middleRows(at, T.rows()), T);
    }
}

void ErrorsInVariables::take_out(const TimesHt& times_Ht, const blas::ConstMatrix& L) {
    if (!has_landmarks()) return;
    MatrixXd Z = times_Ht(C_.topRows(V_.rows()));
    blas::divide(L, Z);
    blas::subtract_square(Z, V_);
    mirror_lower(V_);
}

// C becomes (I - n_s s^T) (I - K H) C (I - K H)^T: as s^T C is next to zero since landmarks were
// added last, with K - n_s (s^T K) for the first K. V likewise.
void ErrorsInVariables::update(const blas::ConstMatrix& gain, const TimesHt& times_Ht,
                               const Scale& scale) {
    MatrixXd of_noise = gain;
    if (has_landmarks() && scale.reading.size() > 0)
        of_noise.noalias() -= scale.direction * (scale.reading.transpose() * gain).eval();
    MatrixXd C_transposed(C_.cols(), C_.rows());
    transpose(C_, C_transposed);
    blas::add_product(-1, of_noise, times_Ht(C_transposed), C_);
    blas::add_product(-1, times_Ht(C_), gain, C_);
    if (!has_landmarks()) return;
    const auto own = of_noise.topRows(V_.rows());
    blas::add_product(-1, own, times_Ht(V_), V_);
    blas::add_product(-1, times_Ht(V_), own, V_);
    mirror_lower(V_);
}

// g~ becomes (I - n_s s^T) g~, where the new landmarks' part of s^T g~ is c^T g~.
void ErrorsInVariables::read_scale_anew(int first, const MatrixXd& G, const Scale& scale) {
    if (!has_landmarks() || scale.reading.size() == 0) return;
    C_ -= scale.direction * (scale.reading.transpose() * C_);
    const VectorXd n = scale.direction.head(V_.rows()),
                   c = G.transpose() * scale.reading.tail(G.rows()),
                   Vc = V_.middleCols(first, c.size()) * c;
    V_ += c.dot(Vc.segment(first, c.size())) * n * n.transpose() - n * Vc.transpose() -
          Vc * n.transpose();
}

double ErrorsInVariables::share_of_motion(double information, std::optional<double> noise) {
    ++updates_;
    latest_noise_ = noise.value_or(latest_noise_);
    information_ += (information - information_) / kUpdates;
    noise_ += (latest_noise_ - noise_) / kUpdates;
    return information_ > 0 ? std::clamp(1 - noise_ / information_, 0.0, 1.0) : 1;
}

}  // namespace vio
