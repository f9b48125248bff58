#include "libvio/io/reference.h"

#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/topography/conversions.h>

#include <functional>

#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"
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

// Poses in order of time, as they come.
class Collector {
 public:
    Collector(RawlogObjects& objects, Reference& reference)
        : objects_(objects), reference_(reference) {}

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
        if (reference_.poses.empty())
            throw InputError(reference_.name + ": the rawlog holds no " + what);
        if (repeated_ > 0)
            reference_.notes.push_back(std::to_string(repeated_) +
                                       " readings with a repeated stamp are left out");
    }

 private:
    RawlogObjects& objects_;
    Reference& reference_;
    int repeated_ = 0;
};

void read_odometry(const std::string& file, Reference& reference) {
    RawlogObjects objects(file);
    Collector collector(objects, reference);
    Pose T_O_B;
    const auto see = [&](const CObservation& observation) {
        if (const auto* reading = dynamic_cast<const CObservationOdometry*>(&observation))
            collector.add(reading->timestamp, from_mrpt(mrpt::poses::CPose3D(reading->odometry)));
    };
    const auto see_action = [&](const CAction& action) {
        const std::optional<Pose> increment = odometry_increment(action);
        if (!increment) return;
        T_O_B = T_O_B * *increment;
        collector.add(action.timestamp, T_O_B);
    };
    for_each(objects, see, see_action);
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

void read_gps(const std::string& file, const ReferenceOptions& options, Reference& reference) {
    RawlogObjects objects(file);
    Collector collector(objects, reference);
    std::optional<GpsMessage> origin;
    int refused = 0;
    const auto usable = [&](int quality) {
        if (options.gps_qualities.empty()) return quality != 0 && quality != 6;
        return options.gps_qualities.count(quality) > 0;
    };
    const auto see = [&](const CObservation& observation) {
        const auto* gps = dynamic_cast<const CObservationGPS*>(&observation);
        const auto fix = gps ? from_mrpt(*gps) : std::nullopt;
        if (!fix) return;
        if (!usable(fix->fix_quality)) {
            ++refused;
            return;
        }
        if (!origin) {
            origin = fix;
            reference.T_B_T = from_mrpt(gps->sensorPose);
        }
        collector.add(gps->timestamp, {Eigen::Matrix3d::Identity(), east_north_up(*fix, *origin)});
    };
    for_each(objects, see, [](const CAction&) {});
    if (options.gps_lever_arm) reference.T_B_T.p = *options.gps_lever_arm;
    reference.has_attitude = false;
    if (refused > 0)
        reference.notes.push_back(std::to_string(refused) +
                                  " fixes are left out for their quality");
    collector.finish(refused > 0 ? "fix of a quality that is taken; see --gps-quality"
                                 : "GPS fix (CObservationGPS with GGA message)");
}

bool ends_with(const std::string& text, const std::string& end) {
    return text.size() > end.size() && text.ends_with(end);
}

}  // namespace

Reference read_reference(const std::string& source, const ReferenceOptions& options) {
    Reference reference;
    reference.name = source;
    const auto file = [&](const char* stream) {
        return source.substr(0, source.size() - std::string(stream).size());
    };
    if (ends_with(source, ":odometry"))
        read_odometry(file(":odometry"), reference);
    else if (ends_with(source, ":gps"))
        read_gps(file(":gps"), options, reference);
    else if (ends_with(source, ".rawlog"))
        throw InputError(source + ": say what of the rawlog to compare with: " + source +
                         ":odometry or " + source + ":gps");
    else
        reference.poses = read_trajectory(source);
    return reference;
}

}  // namespace vio
