// What every importer shares: sources of measurements, and their merging into a rawlog.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"

namespace vio {

/// What was imported.
struct ImportReport {
    int images = 0, feature_frames = 0, imu_readings = 0, gps_fixes = 0, truth_poses = 0;
    LeftOutList left_out;        ///< readings that no measurement could be made of
    TimeNs first = 0, last = 0;  ///< stamps of the first and last measurement
    std::string truth_file;      ///< X.truth.tum, empty if there was no ground truth
    /// What was chosen of the recording, and what of the calibration is missing; one line each.
    std::vector<std::string> remarks;
};

/// One stream of a data set as measurements in order of time.
class MeasurementSource {
 public:
    virtual ~MeasurementSource() = default;

    /// Moves to the next measurement; false at the end. time() is valid while it returned true.
    virtual bool advance() = 0;
    /// The measurement itself, an image is read here; nothing where it was left out.
    std::optional<Message> take();
    virtual double progress() const = 0;  ///< share done, 0 to 1
    /// What was left out so far.
    const LeftOutList& left_out() const { return left_out_; }
    bool any_taken() const { return any_taken_; }
    TimeNs time() const { return time_; }

 protected:
    /// What its measurements are, in the plural.
    virtual const char* what() const = 0;
    /// Throws UnusableMeasurement, with its place, for one that is to be left out.
    virtual Message message() = 0;

    LeftOutList left_out_;

    /// Stamps of one source must increase; `place`, with error(problem), is where this one stands.
    template <typename Place>
    void set_time(TimeNs t, const Place& place) {
        if (started_ && t <= time_)
            throw place.error("the time stamp is not later than the one before");
        started_ = true;
        time_ = t;
    }
    bool started() const { return started_; }

 private:
    TimeNs time_ = 0;
    bool started_ = false, any_taken_ = false;
};

using MeasurementSources = std::vector<std::unique_ptr<MeasurementSource>>;

/// An image that is still a file.
struct ImageFile {
    TimeNs t = 0;
    std::filesystem::path path;
    std::string place;  ///< where it is listed, for errors

    InputError error(const std::string& problem) const {
        return InputError(place + ": " + problem);
    }
};

/// Images of 8 or 16 bits and any number of channels, read as 8-bit grey when their turn comes.
/// bit_depth: see BitDepth; remarks gets what was found. Throws InputError in advance() for stamps
/// that do not increase; a file that is missing or damaged is left out.
std::unique_ptr<MeasurementSource> image_file_source(std::vector<ImageFile> files, int bit_depth,
                                                     std::vector<std::string>& remarks);

/// Measurements that are in memory already.
template <typename Measurement>
class StoredSource final : public MeasurementSource {
 public:
    /// name: where they are from, for errors.
    StoredSource(std::vector<Measurement> measurements, std::string name)
        : measurements_(std::move(measurements)), name_(std::move(name)) {}

    bool advance() override {
        if (next_ == measurements_.size()) return false;
        set_time(measurements_[next_].t, *this);
        ++next_;
        return true;
    }
    double progress() const override {
        return static_cast<double>(next_) / static_cast<double>(measurements_.size());
    }
    InputError error(const std::string& problem) const {
        return InputError(name_ + ": " + problem);
    }

 private:
    const char* what() const override { return "measurements"; }
    Message message() override { return measurements_[next_ - 1]; }

    std::vector<Measurement> measurements_;
    std::string name_;
    size_t next_ = 0;
};

/// Writes the measurements of all sources in order of time; those with one stamp in the order of
/// the sources. Adds to the report's counts. Throws InputError if there are none, and for a source
/// of which all had to be left out.
void merge_sources(MeasurementSources sources, RawlogWriter& writer, ImportReport& report,
                   const std::function<void(double)>& progress);

/// Writes ground truth as X.truth.tum beside X.rawlog.
void write_truth(const std::string& rawlog_file, const std::vector<TimedPose>& poses,
                 ImportReport& report);

}  // namespace vio
