#include "libvio/io/rawlog_info.h"

#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CSensoryFrame.h>

#include <algorithm>
#include <map>
#include <utility>

#include "libvio/base/median.h"
#include "libvio/io/feature_observation.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"

namespace vio {
namespace {

struct Stream {
    StreamInfo info;
    TimeNs previous = 0;
    std::vector<TimeNs> intervals;
};

class Streams {
 public:
    void add(const mrpt::obs::CObservation& observation) {
        const std::pair key{observation.sensorLabel,
                            std::string(observation.GetRuntimeClass()->className)};
        auto [entry, is_new] = index_.try_emplace(key, streams_.size());
        if (is_new) streams_.push_back(first_of(observation));
        count(streams_[entry->second], from_mrpt(observation.timestamp));
    }

    std::vector<StreamInfo> finish() {
        std::vector<StreamInfo> infos;
        for (Stream& stream : streams_) {
            if (!stream.intervals.empty())
                stream.info.median_interval = median(std::move(stream.intervals));
            infos.push_back(stream.info);
        }
        return infos;
    }

 private:
    static Stream first_of(const mrpt::obs::CObservation& observation) {
        Stream stream;
        stream.info.label = observation.sensorLabel;
        stream.info.class_name = observation.GetRuntimeClass()->className;
        stream.info.first = stream.info.last = from_mrpt(observation.timestamp);
        mrpt::poses::CPose3D pose;
        observation.getSensorPose(pose);
        stream.info.T_B_S = from_mrpt(pose);
        return stream;
    }

    static void count(Stream& stream, TimeNs t) {
        StreamInfo& info = stream.info;
        if (info.count++ > 0) {
            const TimeNs interval = t - stream.previous;
            stream.intervals.push_back(interval);
            info.backward_stamps += interval <= 0;
            if (interval > info.largest_gap) {
                info.largest_gap = interval;
                info.largest_gap_at = stream.previous;
            }
        }
        info.first = std::min(info.first, t);
        info.last = std::max(info.last, t);
        stream.previous = t;
    }

    std::map<std::pair<std::string, std::string>, std::size_t> index_;
    std::vector<Stream> streams_;
};

}  // namespace

RawlogInfo read_rawlog_info(const std::string& file, const std::function<void(double)>& progress) {
    register_mrpt_classes();
    RawlogInfo result;
    Streams streams;
    RawlogObjects objects(file);
    bool any = false;
    try {
        while (const auto object = objects.next()) {
            any = true;
            if (const auto* single = dynamic_cast<const mrpt::obs::CObservation*>(object.get()))
                streams.add(*single);
            else if (const auto* frame =
                         dynamic_cast<const mrpt::obs::CSensoryFrame*>(object.get()))
                for (const auto& observation : *frame) streams.add(*observation);
            if (progress) progress(objects.progress());
        }
    } catch (const InputError& damage) {
        if (!any) throw;
        result.damage = damage.what();
    }
    result.streams = streams.finish();
    return result;
}

}  // namespace vio
