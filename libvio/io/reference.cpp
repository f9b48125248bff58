#include "libvio/io/reference.h"

#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/topography/conversions.h>

#include <functional>
#include <map>
#include <set>

#include "libvio/base/files.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
#include "libvio/io/results.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

using namespace mrpt::obs;

// Calls `see` with every observation, and with every action of the older layout, of a rawlog.
void for_each(RawlogObjects& objects, const std::function<void(const CObservation&)>& see,
              const std::function<void(const CAction&)>& see_action) {
    while (const auto object = objects.next()) {
        if (const auto* observation = dynamic_cast<const CObservation*>(object.get()))
            see(*observation);
        else if (const auto* frame = dynamic_cast<const CSensoryFrame*>(object.get()))
            for (const auto& part : *frame) see(*part);
        else if (const auto* actions = dynamic_cast<const CActionCollection*>(object.get()))
            for (const auto& action : *actions) see_action(*action);
    }
}

// One of a rawlog's streams, as asked for.
struct Stream {
    std::string file, kind, label;  // label: empty if any
};

std::string in_quotes(const std::string& label) {
    return "'" + label + "'";
}

// Poses of one source in order of time, as they come.
class Collector {
 public:
    Collector(RawlogObjects& objects, const Stream& stream, Reference& reference)
        : objects_(objects), stream_(stream), reference_(reference) {
        if (!stream.label.empty()) label_ = stream.label;
    }

    /// Whether it is the source that is taken: the one asked for, or the first.
    bool takes(const std::string& label) {
        if (!label_) label_ = label;
        if (label == *label_) return true;
        others_.insert(label);
        return false;
    }

    void add(mrpt::Clock::time_point stamp, const Pose& T_G_T) {
        if (stamp == INVALID_TIMESTAMP)
            throw objects_.error("an observation without time stamp; give it one or remove it");
        const TimeNs t = from_mrpt(stamp);
        auto& poses = reference_.poses;
        if (!poses.empty() && t < poses.back().t)
            throw objects_.error("the stamp " + format_seconds(t) +
                                 " s is before that of the reading before; sort the rawlog");
        if (!poses.empty() && t == poses.back().t)
            ++repeated_;
        else
            poses.push_back({t, T_G_T});
    }

    void finish(const std::string& what) {
        std::string others;
        for (const std::string& label : others_)
            others += (others.empty() ? "" : ", ") + in_quotes(label);
        if (reference_.poses.empty())
            throw InputError(reference_.name + ": the rawlog holds no " + what +
                             (others.empty()
                                  ? ""
                                  : " labelled " + in_quotes(*label_) + "; there are " + others));
        if (repeated_ > 0)
            reference_.notes.push_back(std::to_string(repeated_) +
                                       " readings with a repeated stamp are left out");
        if (!others.empty() && stream_.label.empty())
            reference_.notes.push_back("of several sources " + in_quotes(*label_) +
                                       " is taken; the others are " + others + ": " + stream_.file +
                                       ":" + stream_.kind + ":LABEL");
    }

 private:
    RawlogObjects& objects_;
    const Stream& stream_;
    Reference& reference_;
    std::optional<std::string> label_;
    std::set<std::string> others_;
    int repeated_ = 0;
};

void read_odometry(const Stream& stream, Reference& reference) {
    RawlogObjects objects(stream.file);
    Collector collector(objects, stream, reference);
    Pose T_O_B;
    const auto see = [&](const CObservation& observation) {
        const auto* reading = dynamic_cast<const CObservationOdometry*>(&observation);
        if (reading && collector.takes(reading->sensorLabel))
            collector.add(reading->timestamp, from_mrpt(mrpt::poses::CPose3D(reading->odometry)));
    };
    const auto see_action = [&](const CAction& action) {
        const std::optional<Pose> increment = odometry_increment(action);
        if (!increment || !collector.takes("actions")) return;
        T_O_B = T_O_B * *increment;
        collector.add(action.timestamp, T_O_B);
    };
    for_each(objects, see, see_action);
    reference.is_exact = false;
    collector.finish("odometry (CObservationOdometry)");
}

Eigen::Vector3d east_north_up(const GpsMessage& fix, const GpsMessage& origin) {
    const auto geodetic = [](const GpsMessage& f) {
        return mrpt::topography::TGeodeticCoords(f.latitude_deg, f.longitude_deg, f.altitude_m);
    };
    mrpt::math::TPoint3D p;
    mrpt::topography::geodeticToENU_WGS84(geodetic(fix), p, geodetic(origin));
    return {p.x, p.y, p.z};
}

void read_gps(const Stream& stream, const ReferenceOptions& options, Reference& reference) {
    RawlogObjects objects(stream.file);
    Collector collector(objects, stream, reference);
    std::optional<GpsMessage> origin;
    std::string label = stream.label;       // of what is taken
    std::map<std::string, int> refused_of;  // by label
    const auto usable = [&](int quality) {
        if (options.gps_qualities.empty()) return quality != 0 && quality != 6;
        return options.gps_qualities.count(quality) > 0;
    };
    const auto see = [&](const CObservation& observation) {
        const auto* gps = dynamic_cast<const CObservationGPS*>(&observation);
        const auto fix = gps ? from_mrpt(*gps) : std::nullopt;
        if (!fix) return;
        if (!usable(fix->fix_quality)) {
            ++refused_of[gps->sensorLabel];
            return;
        }
        if (!collector.takes(gps->sensorLabel)) return;
        label = gps->sensorLabel;
        if (!origin) {
            origin = fix;
            reference.T_B_T = from_mrpt(gps->sensorPose);
        }
        collector.add(gps->timestamp, {Eigen::Matrix3d::Identity(), east_north_up(*fix, *origin)});
    };
    for_each(objects, see, [](const CAction&) {});
    if (options.gps_lever_arm) reference.T_B_T.p = *options.gps_lever_arm;
    reference.has_attitude = false;
    int refused = 0;
    for (const auto& [of, count] : refused_of)
        if (of == label || (!origin && stream.label.empty())) refused += count;
    if (refused > 0)
        reference.notes.push_back(std::to_string(refused) +
                                  " fixes are left out for their quality");
    collector.finish(refused > 0 ? "fix of a quality that is taken; see --gps-quality"
                                 : "GPS fix (CObservationGPS with GGA message)");
}

// Of `FILE:KIND` or `FILE:KIND:LABEL`.
std::optional<Stream> stream_of(const std::string& source) {
    for (const std::string kind : {"odometry", "gps"}) {
        const std::string mark = ":" + kind;
        for (auto at = source.rfind(mark); at != std::string::npos && at > 0;
             at = source.rfind(mark, at - 1)) {
            const std::string rest = source.substr(at + mark.size());
            if (rest.empty()) return Stream{source.substr(0, at), kind, ""};
            if (rest[0] == ':' && rest.size() > 1)
                return Stream{source.substr(0, at), kind, rest.substr(1)};
        }
    }
    return std::nullopt;
}

}  // namespace

Reference read_reference(const std::string& source, const ReferenceOptions& options) {
    Reference reference;
    reference.name = source;
    if (is_folder(source)) {
        const Estimate estimate = read_results(source);
        reference.poses = trajectory(estimate);
        reference.has_scale = estimate.has_scale;
        reference.is_exact = false;
    } else if (const std::optional<Stream> stream = stream_of(source)) {
        if (stream->kind == "odometry")
            read_odometry(*stream, reference);
        else
            read_gps(*stream, options, reference);
    } else if (source.ends_with(".rawlog")) {
        throw InputError(source + ": say what of the rawlog to compare with: " + source +
                         ":odometry or " + source + ":gps");
    } else {
        reference.poses = read_trajectory(source);
        reference.is_file = true;
    }
    return reference;
}

}  // namespace vio
