// The part of a recording that --from and --to name.
#pragma once

#include <CLI/CLI.hpp>
#include <limits>
#include <optional>
#include <string>

#include "libvio/io/recording.h"

namespace vio::app {

/// Seconds from the recording's first measurement.
struct PartRequest {
    /// Nothing: all up to the end, also what is stamped before the first measurement.
    std::optional<double> begin_s;
    double end_s = std::numeric_limits<double>::infinity();
};

/// Declares --from and --to. use: begins each help text.
void add_part_options(CLI::App& command, PartRequest& part, const std::string& use = "");
/// Throws InputError where nothing lies between them.
void check(const PartRequest& part);

/// Whether a measurement lies in the part that was asked for. IMU readings around it belong to it,
/// so that its first and last image lie between readings.
class Part {
 public:
    /// window: IekfOptions::message_window [s].
    explicit Part(const PartRequest& request, double window) : request_(request), window_(window) {}

    /// Of each measurement in order of the file.
    bool contains(const Message& message);

    /// Why nothing of what was read lies in the part; empty if something does.
    std::string why_empty() const;

    /// Whether none of the part is to come: one message beyond it may have a wrong stamp.
    bool is_over() const { return beyond_ > 100; }

    /// With --from: measurements that are stamped before the first one by more than the window, of
    /// which nobody can tell where they lie. Without, they belong to the part.
    int late() const { return late_; }
    int late_images() const { return late_images_; }  ///< or their features; of late()

 private:
    PartRequest request_;
    double window_;
    bool begun_ = false, any_ = false;
    TimeNs origin_ = 0;
    double last_ = 0;  // [s]
    int beyond_ = 0;   // messages in a row
    int late_ = 0, late_images_ = 0;
};

}  // namespace vio::app
