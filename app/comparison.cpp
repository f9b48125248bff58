#include "app/comparison.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "app/recording_text.h"
#include "libvio/base/errors.h"
#include "libvio/base/files.h"
#include "libvio/io/recording.h"
#include "libvio/io/results.h"
#include "libvio/io/trajectory_io.h"

namespace vio::app {
namespace {

AlignmentKind alignment_kind(const std::string& name, bool has_scale) {
    if (name == "none") return AlignmentKind::kNone;
    if (name == "yaw") return AlignmentKind::kYawPosition;
    if (name == "sim3" || (name == "auto" && !has_scale)) return AlignmentKind::kSim3;
    return AlignmentKind::kSE3;
}

std::vector<TimeNs> image_stamps(const std::string& rawlog, const std::string& camera_label) {
    std::vector<TimeNs> stamps;
    RecordingOptions which;
    which.camera_label = camera_label;
    Recording recording(rawlog, which);
    while (const auto message = recording.next()) {
        if (const auto* image = std::get_if<ImageMessage>(&*message)) stamps.push_back(image->t);
        if (const auto* frame = std::get_if<FeatureFrame>(&*message)) stamps.push_back(frame->t);
    }
    std::sort(stamps.begin(), stamps.end());  // a file with images and features has each twice
    stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
    return stamps;
}

// Images of the recording that a results folder was made from, where it says so.
ExpectedImages images_of(const std::string& folder) {
    std::ifstream file(folder + "/summary.json");
    const auto summary = nlohmann::json::parse(file, nullptr, false);
    ExpectedImages images;
    if (!summary.is_object()) return images;
    images.image_count = summary.value("images_in_recording", 0);
    if (summary.contains("images"))
        images.images_with_pose = summary.value("images", 0) - summary.value("images_lost", 0);
    return images;
}

std::vector<TimedPose> followed(std::vector<TimedPose> poses, const Pose& T) {
    for (TimedPose& row : poses) row.T_W_B = row.T_W_B * T;
    return poses;
}

Pose tracked_pose(const std::vector<double>& v) {
    Pose T;
    if (v.empty()) return T;
    T.p = {v[0], v[1], v[2]};
    if (v.size() == 6)
        T.R = (Eigen::AngleAxisd(v[3], Eigen::Vector3d::UnitZ()) *
               Eigen::AngleAxisd(v[4], Eigen::Vector3d::UnitY()) *
               Eigen::AngleAxisd(v[5], Eigen::Vector3d::UnitX()))
                  .toRotationMatrix();
    return T;
}

}  // namespace

void add_options(CLI::App& command, ComparisonOptions& options, bool against_required) {
    EvaluationOptions& evaluation = options.evaluation;
    command
        .add_option("--against", options.against,
                    "Truth: trajectory (TUM, EuRoC, KITTI or MRPT text), FILE.rawlog:odometry or "
                    "FILE.rawlog:gps (of several sources FILE.rawlog:gps:LABEL), or another "
                    "results folder; several allowed")
        ->required(against_required);
    command
        .add_option("--align", options.alignment,
                    "Alignment before errors are taken; auto: se3, sim3 for results without scale")
        ->check(CLI::IsMember({"auto", "none", "yaw", "se3", "sim3"}))
        ->capture_default_str();
    CLI::Option* rawlog =
        command.add_option("--rawlog", options.rawlog,
                           "Recording of the result: completion is counted against its images");
    add_camera_label(command, options.camera_label)->needs(rawlog);
    command
        .add_option("--start-offset", evaluation.images.start_offset_s,
                    "Images up to this long after the first need no pose [s]")
        ->needs(rawlog)
        ->check(CLI::NonNegativeNumber);
    command
        .add_option("--max-gap", evaluation.max_gap_s,
                    "Widest gap in the truth that is interpolated over [s]; default: 2.5 times "
                    "its median interval")
        ->check(CLI::PositiveNumber);
    command.add_option("--at", evaluation.at_s,
                       "Judge only the poses nearest to these times after the truth's first [s], "
                       "as where a machine passes known points");
    CLI::Option* offset = command.add_option("--time-offset", evaluation.time_offset_s,
                                             "Truth's stamp minus estimate's [s]");
    command
        .add_option("--find-time-offset", evaluation.time_offset_search_s,
                    "Estimate the time offset, within plus or minus this [s]")
        ->excludes(offset)
        ->check(CLI::PositiveNumber);
    command
        .add_option("--tracked", options.tracked,
                    "Pose of what a truth file tracks, in the body frame: x y z [m] and, if it is "
                    "turned, yaw pitch roll [rad]")
        ->expected(3, 6);
    command.add_option("--rpe-distance", evaluation.rpe_distances_m,
                       "Lengths of the relative error [m]; default: 10, 20 ... 50 % of the path");
    command.add_option("--rpe-time", evaluation.rpe_times_s, "The same in seconds")
        ->capture_default_str();
    command.add_option("--gps-quality", options.gps_qualities,
                       "GGA qualities of the fixes to take (1: GPS, 2: differential, 4: RTK fixed, "
                       "5: RTK float); default: all but none and dead reckoning");
    command
        .add_option("--gps-lever-arm", options.gps_lever_arm,
                    "Antenna in the body frame, x y z [m], in place of the rawlog's sensorPose")
        ->expected(3);
}

std::vector<Reference> read_references(const ComparisonOptions& options) {
    if (options.tracked.size() % 3 != 0)
        throw InputError("--tracked: give 3 numbers, or 6 with the angles");
    ReferenceOptions how;
    how.gps_qualities.insert(options.gps_qualities.begin(), options.gps_qualities.end());
    if (!options.gps_lever_arm.empty())
        how.gps_lever_arm = Eigen::Vector3d::Map(options.gps_lever_arm.data());
    std::vector<Reference> references;
    for (const std::string& source : options.against) {
        references.push_back(read_reference(source, how));
        if (references.back().is_file) references.back().T_B_T = tracked_pose(options.tracked);
    }
    return references;
}

JudgedResult read_judged(const std::string& result) {
    JudgedResult judged;
    judged.name = result;
    if (!is_folder(result)) {
        judged.poses = read_trajectory(result);
        return judged;
    }
    judged.images = images_of(result);
    const Estimate estimate = read_results(result);
    judged.has_scale = estimate.has_scale;
    if (!estimate.innovations.empty()) judged.first_update = estimate.innovations.front().t;
    judged.poses = trajectory(estimate);
    for (const StateEstimate& state : estimate.states)
        if (state.lost) judged.images.lost.push_back(state.t);
    if (!estimate.has_scale) {  // its covariance is in arbitrary units
        const Rig rig = read_results_rig(result);
        if (rig.camera) judged.T_B_C = rig.T_B_C;
        return judged;
    }
    judged.covariances.emplace();
    for (const StateEstimate& state : estimate.states)
        judged.covariances->push_back(state.covariance.topLeftCorner<6, 6>());
    return judged;
}

Evaluation compare(const JudgedResult& result, const Reference& reference,
                   const ComparisonOptions& options) {
    if (result.has_scale && !reference.has_scale)
        throw InputError(result.name + " against " + reference.name +
                         ": the latter has no scale; compare it with the former");
    EvaluationOptions how = options.evaluation;
    how.alignment = alignment_kind(options.alignment, result.has_scale);
    how.estimate_name = result.name;
    how.truth_name = reference.name;
    how.T_B_T = reference.T_B_T;
    how.truth_has_attitude = reference.has_attitude;
    how.truth_is_exact = reference.is_exact;
    how.estimate_has_scale = result.has_scale;
    how.first_update = result.first_update;
    how.images.image_count = result.images.image_count;
    how.images.images_with_pose = result.images.images_with_pose;
    how.images.lost = result.images.lost;
    if (!options.rawlog.empty())
        how.images.stamps = image_stamps(options.rawlog, options.camera_label);
    Evaluation evaluation;
    if (result.T_B_C && reference.has_attitude) {
        how.T_B_T = {};
        evaluation =
            evaluate(followed(result.poses, *result.T_B_C),
                     followed(reference.poses, reference.T_B_T.inverse() * *result.T_B_C), how);
    } else {
        evaluation = evaluate(result.poses, reference.poses, how, result.covariances);
    }
    evaluation.warnings.insert(evaluation.warnings.begin(), reference.notes.begin(),
                               reference.notes.end());
    return evaluation;
}

}  // namespace vio::app
