// An estimated trajectory judged against truth (paper, section 6.4).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "libvio/evaluation/association.h"
#include "libvio/evaluation/metrics.h"
#include "libvio/geometry/alignment.h"

namespace vio {

/// Of which images the estimate is to hold a pose. With stamps each image is looked for; without,
/// the poses from the first one on, or images_with_pose, are counted against image_count.
struct ExpectedImages {
    std::vector<TimeNs> stamps;           ///< of the sequence's images, in the estimate's time
    int image_count = 0;                  ///< used where there are no stamps; 0: unknown
    std::optional<int> images_with_pose;  ///< of these; not every pose may be an image's
    /// Poses that the estimate itself calls lost, in order: their images do not count as having
    /// one.
    std::vector<TimeNs> lost;
    double start_offset_s = 0;        ///< images up to this long after the first are not asked for
    double stamp_tolerance_s = 1e-3;  ///< between an image and its pose
};

/// How a trajectory is brought onto the truth and judged.
struct EvaluationOptions {
    AlignmentKind alignment = AlignmentKind::kSE3;
    /// Widest gap in the truth that is interpolated over; default: 2.5 times its median interval.
    std::optional<double> max_gap_s;
    double time_offset_s = 0;         ///< t_truth = t_estimate + time_offset
    double time_offset_search_s = 0;  ///< above 0: the offset is estimated, within +- this
    /// The truth is known at these times alone [s after its first row], as at a machine's control
    /// points: of the estimate, the pose nearest to each is judged, unless it is farther away
    /// than the median interval between poses. Empty: wherever there is truth.
    std::vector<double> at_s;
    Pose T_B_T;  ///< pose of what the truth tracks, in the estimate's body frame
    bool estimate_has_scale = true;  ///< false (image-only): the scale error (27) has no meaning
    bool truth_has_attitude = true;  ///< false: rotations and steps are not judged
    bool truth_is_exact = true;      ///< false: it errs as the estimate does; NEES is not taken
    ExpectedImages images;
    /// The first image that the recursive estimator took up after its start: earlier poses come
    /// from the batch over its prefix. Nothing: not known, or no recursive estimate.
    std::optional<TimeNs> first_update;
    /// Lengths of the relative pose error. Distances left empty: 10, 20, 30, 40 and 50 % of the
    /// true path.
    std::vector<double> rpe_distances_m;
    std::vector<double> rpe_times_s = {1.0};
    /// Named in error messages.
    std::string estimate_name = "estimate", truth_name = "truth";
};

/// Error of one pose after alignment, in the truth's world G.
struct PoseError {
    TimeNs t = 0;
    int estimate_idx = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< estimate - truth [m]
    double rotation = 0;                                 ///< angle [rad]
};

/// Stretch between two rows of truth that is too long to be interpolated over.
struct TruthGap {
    TimeNs from = 0, to = 0;  ///< in the estimate's time
};

/// Growth of the error along the path: the relative errors over all distances, each divided by its
/// distance, averaged over all steps (as the KITTI benchmark does).
struct Drift {
    double translation = 0;  ///< [-]
    double rotation = 0;     ///< [rad/m]
};

/// For how many images there is a pose that is not lost.
struct Completion {
    int expected = 0;   ///< images in the interval; 0: not known
    int estimated = 0;  ///< of these, with a pose
    double share() const { return expected > 0 ? double(estimated) / expected : 0; }
};

/// Errors of the poses that a recursive estimate gave image by image, those of its start left out;
/// of the same alignment.
struct AfterStart {
    int poses = 0, start_poses = 0;
    ErrorStatistics position, rotation;  ///< [m], [rad]
};

/// Every figure of merit of one trajectory, after the alignment.
struct Evaluation {
    std::string estimate_name, truth_name;
    Alignment alignment;       ///< the one that was asked for, and applied
    ErrorStatistics position;  ///< [m]
    ErrorStatistics rotation;  ///< [rad]
    std::optional<AfterStart> after_start;
    /// 1/s - 1 of the Sim(3) alignment (27), whatever alignment was asked for; nothing if the path
    /// is too short to tell (two poses, or one place).
    std::optional<double> scale_error;
    std::vector<RelativeError> rpe_distance, rpe_time;
    std::optional<Drift> drift;  ///< if there are steps over a distance
    bool has_rotation = true;    ///< false: the truth has no attitude; rotation and steps are empty
    double time_offset_s = 0;    ///< as given or estimated
    bool time_offset_estimated = false;
    double max_gap_s = 0;        ///< of the truth, interpolated over
    std::vector<TruthGap> gaps;  ///< wider ones, within the estimate's time
    Completion completion;
    std::optional<Nees> nees;           ///< if covariances were given, and it has a meaning
    std::string no_nees;                ///< why it has none, though covariances were given
    int estimated_poses = 0;            ///< in the whole estimate
    int lost_poses = 0;                 ///< of these, as the estimate itself says
    int associated_poses = 0;           ///< with truth at their time
    double estimate_path_length = 0;    ///< of the associated poses, before alignment [m]
    double truth_path_length = 0;       ///< of the associated poses [m]
    double duration_s = 0;              ///< from first to last associated pose
    std::vector<PoseError> errors;      ///< one for each associated pose
    std::vector<std::string> warnings;  ///< one line each
};

/// Associates, aligns and measures. covariances, if given, are those of the estimated poses (one
/// each, in the tangent order of Pose). Throws InputError (one line) for an estimate or truth that
/// check_trajectory() refuses, no overlap in time, one pose, a truth in another unit, or a path
/// that leaves the alignment undetermined (a straight line with SE(3) or Sim(3), one place).
Evaluation evaluate(const std::vector<TimedPose>& estimate, const std::vector<TimedPose>& truth,
                    const EvaluationOptions& options = {},
                    const std::optional<std::vector<Matrix6d>>& covariances = std::nullopt);

/// The aligned estimate, whole, in the truth's world.
std::vector<TimedPose> apply(const Similarity& S_G_E, const std::vector<TimedPose>& estimate);

/// A short table for people: metres, degrees, percent.
std::string to_text(const Evaluation& evaluation);

/// Several evaluations beside each other, one line each: what each of them is to_text() tells.
std::string to_table(const std::vector<Evaluation>& evaluations);

/// Machine-readable; the unit is part of each name. Holds the statistics, not the single errors.
nlohmann::ordered_json to_json(const Evaluation& evaluation);

}  // namespace vio
