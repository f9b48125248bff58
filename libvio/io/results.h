// The results folder: everything that a run leaves, in fixed file names.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "libvio/base/estimate.h"
#include "libvio/camera/rig.h"

namespace vio {

/// What goes into a results folder.
struct Results {
    Estimate estimate;
    Rig rig;                              ///< stored with the key-frames
    std::vector<FeatureFrame> keyframes;  ///< frames for keyframes.simplemap
    std::string options_ini;              ///< text of options.ini (OptionSet::to_ini)
    /// Caller's part of summary.json (an object). The writer adds images, landmarks, duration_s,
    /// path_length_m, gravity and has_scale.
    nlohmann::json summary = nlohmann::json::object();
};

/// Throws InputError if the folder cannot hold results: a file of that name exists, it cannot be
/// made, or it holds results already and overwrite is false. Call before long work.
void check_results_folder(const std::string& folder, bool overwrite);

/// Writes the whole folder (made if missing; other files in it are left alone); results that come
/// piece by piece: ResultsWriter. Formats: share/formats.md. Throws as check_results_folder does,
/// and if the disk is full.
void write_results(const std::string& folder, const Results& results, bool overwrite = false);

/// Reads an estimate back from trajectory.tum (required), trajectory_cov.txt, states.csv,
/// innovations.csv, landmarks.ply and summary.json (each optional: what it holds is left at its
/// default). Covariances of velocity and biases come back as their diagonals, without correlations.
/// Throws InputError (file and line) for a missing trajectory or malformed content.
Estimate read_results(const std::string& folder);

/// The calibration that the run used, from calibration.ini; a rig without a camera where there is
/// no such file. Throws as load_calibration().
Rig read_results_rig(const std::string& folder);

}  // namespace vio
