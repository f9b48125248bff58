// What the commands print of a recording.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "libvio/check/finding.h"
#include "libvio/io/rawlog_info.h"
#include "libvio/io/recording.h"

namespace vio::app {

/// Declares --calibration, --camera-label, --imu-label and --bit-depth.
/// use: begins each help text.
void add_recording_options(CLI::App& command, RecordingOptions& options,
                           const std::string& use = "");
/// The one of them that says whose images count.
CLI::Option* add_camera_label(CLI::App& command, std::string& label, const std::string& use = "");

/// How 16-bit images are taken (BitDepth).
CLI::Option* add_bit_depth(CLI::App& command, int& bits, const std::string& use = "");

/// Reads the file once and prints one line for each stream. Returns why reading stopped early;
/// empty: it did not.
std::string print_streams(const std::string& rawlog);

/// Prints the calibration in both directions.
void print_calibration(const Recording& recording);

/// Prints a line for each kind of measurement that was left out.
void print_left_out(const LeftOutList& left_out);
/// A line of what else is to be known.
void print_note(const std::string& text);
/// A line for messages that were left out for their stamps, if there are any. window:
/// IekfOptions::message_window [s].
void print_repeated(int messages);
void print_late(int messages, double window);
/// The same as warnings.
std::vector<Finding> left_out_findings(const LeftOutList& left_out);

}  // namespace vio::app
