#include "libvio/batch/normal_equations.h"

#include <algorithm>
#include <cmath>

#include "libvio/batch/parallel.h"

namespace vio::batch {
namespace {

BlockMatrix make_matrix(const Model& model, const Layout& layout) {
    std::vector<std::pair<int, int>> pairs;
    const int global = layout.global_block();
    for (int i = 0; layout.inertial && i < layout.frames; ++i) {
        pairs.emplace_back(layout.motion_block(i), layout.pose_block(i));
        pairs.emplace_back(global, layout.pose_block(i));
        pairs.emplace_back(global, layout.motion_block(i));
        if (i == 0) continue;
        for (int row : {layout.pose_block(i), layout.motion_block(i)})
            for (int col : {layout.pose_block(i - 1), layout.motion_block(i - 1)})
                pairs.emplace_back(row, col);
    }
    for (const Observation& observation : model.observations)
        if (const int slot = layout.border_of_point[observation.point_idx]; slot >= 0)
            pairs.emplace_back(layout.border_block(slot), layout.pose_block(observation.frame_idx));
    return BlockMatrix(layout.block_dims(), std::move(pairs));
}

// The images of each eliminated point.
BlockSets make_sets(const Model& model, const Layout& layout) {
    BlockSets sets;
    for (size_t j = 0; j < model.points.size(); ++j) {
        const Point& point = model.points[j];
        sets.terms.push_back(point.first_observation);
        if (layout.border_of_point[j] < 0)
            for (int k = 0; k < point.observation_count; ++k)
                sets.blocks.push_back(
                    layout.pose_block(model.observations[point.first_observation + k].frame_idx));
        sets.first.push_back(static_cast<int>(sets.blocks.size()));
    }
    return sets;
}

struct Frames {
    int first, last;
};

Frames frames_of(const Model& model, const Point& point) {
    const Observation* begin = &model.observations[point.first_observation];
    return {begin->frame_idx, begin[point.observation_count - 1].frame_idx};
}

// The images that stand between two halves of the problem: no eliminated point is seen in both
// halves. Empty (first > last) where the problem does not come apart.
Frames find_separator(const Model& model, const Layout& layout) {
    const int n = layout.frames;
    std::vector<int> reach(n, 0);  // last image of points that begin at or before each image
    for (size_t j = 0; j < model.points.size(); ++j) {
        if (layout.border_of_point[j] >= 0) continue;
        const Frames seen = frames_of(model, model.points[j]);
        reach[seen.first] = std::max(reach[seen.first], seen.last);
    }
    for (int i = 1; i < n; ++i) reach[i] = std::max(reach[i], reach[i - 1]);
    Frames best{0, -1};
    int best_cost = 3 * n / 4;
    for (int first = 1; first + 1 < n; ++first) {
        const int last = std::max(first, reach[first - 1]);
        const int cost = std::max(first, n - 1 - last) + (last - first + 1);
        if (cost >= best_cost) continue;
        best_cost = cost;
        best = {first, last};
    }
    return best;
}

std::vector<Part> make_parts(const Model& model, const Layout& layout) {
    const Frames separator = find_separator(model, layout);
    const auto part_of = [&](const Frames& seen) {
        if (seen.last < separator.first || separator.last < separator.first)
            return Part::first_half;
        if (seen.first > separator.last) return Part::second_half;
        if (seen.first < separator.first && seen.last <= separator.last) return Part::first_half;
        if (seen.first >= separator.first && seen.last > separator.last) return Part::second_half;
        return Part::between;
    };
    std::vector<Part> parts;
    for (int i = 0; i < layout.frames; ++i)
        parts.insert(parts.end(), layout.blocks_per_frame(), part_of({i, i}));
    for (size_t j = 0; j < model.points.size(); ++j)
        if (layout.border_of_point[j] >= 0)
            parts.push_back(part_of(frames_of(model, model.points[j])));
    if (layout.inertial) parts.push_back(Part::last);
    return parts;
}

}  // namespace

Step& Step::operator*=(double length) {
    reduced *= length;
    for (Eigen::Vector3d& d : points) d *= length;
    rig *= length;
    return *this;
}

NormalEquations::NormalEquations(const Model& model, const Layout& layout, int threads)
    : matrix(make_matrix(model, layout)),
      gradient(Eigen::VectorXd::Zero(matrix.size())),
      V(model.points.size()),
      b(model.points.size()),
      W(model.observations.size(), Matrix63d::Zero()),
      model_(model),
      layout_(layout),
      threads_(threads),
      factor_(matrix, make_sets(model, layout), make_parts(model, layout), threads),
      V_root_(model.points.size(), Eigen::Matrix3d::Zero()),
      damping_(Eigen::VectorXd::Zero(matrix.size())) {}

void NormalEquations::set_zero() {
    matrix.set_zero();
    gradient.setZero();
    std::fill(V.begin(), V.end(), Eigen::Matrix3d::Zero());
    std::fill(b.begin(), b.end(), Eigen::Vector3d::Zero());
}

double NormalEquations::damping(double diagonal) const {
    return lambda_ * std::clamp(diagonal, 1e-6, 1e32);
}

Eigen::Matrix3d NormalEquations::point_damping_matrix(int j) const {
    if (point_damping == PointDamping::as_seen) return lambda_ * V[j];
    return damping(V[j].trace() / 3) * Eigen::Matrix3d::Identity();
}

bool NormalEquations::invert_points() {
    bool good[kPieces];
    const int count = static_cast<int>(V.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        good[piece] = true;
        for (int j = piece_begin(count, kPieces, piece); j < piece_begin(count, kPieces, piece + 1);
             ++j) {
            if (layout_.border_of_point[j] >= 0) continue;
            const Eigen::LLT<Eigen::Matrix3d> llt(V[j] + point_damping_matrix(j));
            good[piece] &= llt.info() == Eigen::Success;
            V_root_[j].setIdentity();
            llt.matrixU().solveInPlace(V_root_[j]);
        }
    });
    return std::all_of(good, good + kPieces, [](bool g) { return g; });
}

bool NormalEquations::eliminate(double lambda) {
    lambda_ = lambda;
    for (int k = 0; k < matrix.size(); ++k) damping_(k) = damping(matrix.diagonal(k));
    return invert_points() && factor_.factorize({matrix, damping_, gradient, W, V_root_, b});
}

bool NormalEquations::factorize(double lambda) {
    rig_solution_.reset();
    shared_errors_.reset();
    if (!eliminate(lambda)) return false;
    if (rig) solve_rig_covariance();
    shared_errors_ = rig_solution_;
    return true;
}

bool NormalEquations::solve(double lambda, Step& step) {
    if (!eliminate(lambda)) return false;
    factor_.solve(step.reduced);
    return complete(step);
}

bool NormalEquations::resolve(Step& step) {
    if (!invert_points()) return false;
    step.reduced = factor_.solve(reduced_gradient());
    return complete(step);
}

// a - W V^-1 b.
Eigen::VectorXd NormalEquations::reduced_gradient() const {
    Eigen::VectorXd sum = gradient;
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;
        const Eigen::Vector3d scaled = V_root_[j] * (V_root_[j].transpose() * b[j]);
        const Point& point = model_.points[j];
        for (int k = point.first_observation; k < point.first_observation + point.observation_count;
             ++k)
            sum.segment<6>(layout_.index(model_.observations[k].frame_idx, 0)).noalias() -=
                W[k] * scaled;
    }
    return sum;
}

// From the reduced solution of the right-hand side itself.
bool NormalEquations::complete(Step& step) const {
    step.reduced *= -1;
    if (rig && !solve_rig(step)) return false;
    solve_points(step);
    return step.reduced.allFinite();
}

void NormalEquations::solve_points(Step& step) const {
    step.points.resize(V.size());
    const int count = static_cast<int>(V.size());
    in_parallel(threads_, kPieces, [&](int piece) {
        for (int j = piece_begin(count, kPieces, piece); j < piece_begin(count, kPieces, piece + 1);
             ++j) {
            const int slot = layout_.border_of_point[j];
            if (slot >= 0) {
                step.points[j] = step.reduced.segment<3>(matrix.offset(layout_.border_block(slot)));
                continue;
            }
            Eigen::Vector3d rhs = b[j];
            if (rig) rhs.noalias() += rig->points.middleRows<3>(3L * j) * step.rig;
            const Point& point = model_.points[j];
            for (int k = point.first_observation;
                 k < point.first_observation + point.observation_count; ++k)
                rhs.noalias() += W[k].transpose() * step.reduced.segment<6>(layout_.index(
                                                        model_.observations[k].frame_idx, 0));
            step.points[j] = -(V_root_[j] * (V_root_[j].transpose() * rhs));
        }
    });
}

double NormalEquations::predicted_decrease(const Step& step) const {
    // For the damped solution: dx^T (lambda D dx - g), cost being the sum of squares (no 1/2).
    double sum = 0;
    for (int k = 0; k < step.reduced.size(); ++k)
        sum += step.reduced(k) * (damping_(k) * step.reduced(k) - gradient(k));
    for (size_t j = 0; j < V.size(); ++j) {
        if (layout_.border_of_point[j] >= 0) continue;  // counted with the reduced unknowns
        sum -= step.points[j].dot(b[j]);
        sum += step.points[j].dot(point_damping_matrix(static_cast<int>(j)) * step.points[j]);
    }
    for (Eigen::Index k = 0; rig && k < step.rig.size(); ++k)
        sum += step.rig(k) * (damping(rig->H(k, k)) * step.rig(k) - rig->gradient(k));
    return sum;
}

}  // namespace vio::batch
