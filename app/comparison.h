// A result, folder or trajectory file, compared with references: what evaluate and report share.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "libvio/evaluation/evaluate.h"
#include "libvio/io/reference.h"

namespace vio::app {

/// With what a result is compared, and how.
struct ComparisonOptions {
    std::vector<std::string> against;  ///< references, see read_reference
    std::string alignment = "auto";    ///< auto | none | yaw | se3 | sim3
    std::string rawlog;                ///< recording of the result, for completion; empty: none
    std::string camera_label;          ///< of the rawlog, whose images count; empty: the first
    std::vector<double> tracked;       ///< pose of what a file's truth tracks: x y z yaw pitch roll
    std::vector<int> gps_qualities;
    std::vector<double> gps_lever_arm;
    EvaluationOptions evaluation;
};

/// Declares the options on a command.
void add_options(CLI::App& command, ComparisonOptions& options, bool against_required);

/// The references that the options name. Throws InputError.
std::vector<Reference> read_references(const ComparisonOptions& options);

/// A result as it is judged.
struct JudgedResult {
    std::string name;
    std::vector<TimedPose> poses;
    std::optional<std::vector<Matrix6d>> covariances;
    bool has_scale = true;
    ExpectedImages images;               ///< as far as the result tells
    std::optional<TimeNs> first_update;  ///< see EvaluationOptions
    /// Camera in the body, of a result without scale: such a result is judged at the camera, since
    /// its place in the body is metric and the result is not.
    std::optional<Pose> T_B_C;
};

/// Reads a results folder, or a trajectory in any layout of read_trajectory().
JudgedResult read_judged(const std::string& result);

/// Alignment auto: SE(3), or Sim(3) for a result without scale. Throws InputError as evaluate()
/// does.
Evaluation compare(const JudgedResult& result, const Reference& reference,
                   const ComparisonOptions& options);

}  // namespace vio::app
