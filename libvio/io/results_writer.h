// Writing a results folder while the estimator runs, in memory that does not grow with the run.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio {

/// What has been written of a path.
struct WrittenPath {
    int poses = 0, lost_poses = 0, landmarks = 0;
    TimeNs first = 0, last = 0;
    double length = 0;  ///< [m] if the estimate has a scale
    /// What a file lacks, in words, and the time that it lacks it from: known after finish().
    std::vector<std::pair<TimeNs, std::string>> shortfalls;
};

/// The path (trajectory.tum, trajectory_cov.txt, trajectory.txt, states.csv,
/// of the filter innovations.csv) grows row by row: the
/// files of a run that was killed are valid up to there. Landmarks and key-frames go to
/// landmarks.partial and keyframes.partial, from which finish() makes the other files, each of
/// which appears complete or not at all; summary.json, the last, says that the run was finished.
/// Files of earlier results are removed when the first state comes. Formats: share/formats.md.
class ResultsWriter {
 public:
    /// Nothing is written before the first state. rig: stored with the key-frames. Throws as
    /// check_results_folder does.
    ResultsWriter(const std::string& folder, const Rig& rig, const std::string& options_ini,
                  bool overwrite);
    ~ResultsWriter();

    /// The rig as estimated; before the first state.
    void set_rig(const Rig& rig);

    /// Appends states, in order of time, with the estimate's gravity, and notes landmarks: of
    /// several with one id the last counts. Throws InputError if the disk is full.
    void add(const Estimate& piece);

    /// A frame for keyframes.simplemap: written if a state of its time comes, or came last.
    void add_keyframe(const FeatureFrame& frame);
    const WrittenPath& written() const;

    /// Completes the folder. summary: the caller's part of summary.json (an object); images,
    /// landmarks, duration_s, path_length_m, gravity and has_scale are added to it, shortfalls to
    /// its events. Call after the first state. Throws InputError if the disk is full.
    void finish(const nlohmann::json& summary);

 private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace vio
