#include "libvio/io/rawlog_info.h"

#include <mrpt/obs/CObservation.h>
#include <mrpt/obs/CSensoryFrame.h>

#include <map>
#include <utility>

#include "libvio/io/feature_observation.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/rawlog_objects.h"

namespace vio {
namespace {

class Streams {
 public:
    void add(const mrpt::obs::CObservation& observation) {
        const std::pair key{observation.sensorLabel,
                            std::string(observation.GetRuntimeClass()->className)};
        auto [entry, is_new] = index_.try_emplace(key, streams.size());
        if (is_new) {
            mrpt::poses::CPose3D pose;
            observation.getSensorPose(pose);
            streams.push_back({key.first, key.second, from_mrpt(pose), {}});
        }
        streams[entry->second].stamps.push_back(from_mrpt(observation.timestamp));
    }

    std::vector<StreamInfo> streams;

 private:
    std::map<std::pair<std::string, std::string>, std::size_t> index_;
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
    result.streams = std::move(streams.streams);
    return result;
}

}  // namespace vio
