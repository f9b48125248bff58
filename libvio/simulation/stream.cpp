#include "libvio/simulation/stream.h"

#include <algorithm>
#include <map>
#include <tuple>

namespace vio {

void StreamModel::describe(OptionSet& set) {
    set.section("messages");
    set.add("image_drop_rate", &image_drop_rate, "-", {0, 0.9},
            "share of the images, or of their features, that are lost");
    set.add("imu_drop_rate", &imu_drop_rate, "-", {0, 0.9}, "share of the readings that are lost");
    set.add("longest_drop", &longest_drop, "-", {1, 1e6},
            "messages of a kind that are lost in a row: 1 to this many");
    set.add("duplicate_rate", &duplicate_rate, "-", {0, 1},
            "share of the messages that are written twice");
    const auto fault = [&set](const std::string& name, StreamModel::Fault& f, const char* what) {
        set.add(name + "_from", &f.from, "s", {0, 1e6},
                "time after the first image from which " + std::string(what));
        set.add(name, &f.length, "s", {0, 1e6}, "for how long " + std::string(what) + "; 0: never");
    };
    fault("no_images", no_images, "there are no images");
    fault("no_readings", no_readings, "there are no inertial readings");
    fault("dark", dark, "the images are black");
}

std::vector<StreamEntry> arranged(std::vector<StreamEntry> entries, const StreamModel& model,
                                  Random& random) {
    using Kind = StreamEntry::Kind;
    std::stable_sort(entries.begin(), entries.end(), [](const auto& a, const auto& b) {
        return std::tie(a.t, a.kind) < std::tie(b.t, b.kind);
    });
    const auto first = std::find_if(entries.begin(), entries.end(),
                                    [](const auto& e) { return e.kind == Kind::kImage; });
    if (first != entries.end())
        std::erase_if(entries, [&, t0 = first->t](const StreamEntry& e) {
            return (e.kind == Kind::kImage && model.no_images.holds(e.t, t0)) ||
                   (e.kind == Kind::kImu && model.no_readings.holds(e.t, t0));
        });
    std::map<Kind, double> rate{{Kind::kImage, model.image_drop_rate},
                                {Kind::kImu, model.imu_drop_rate}};
    std::map<Kind, int> dropping;  // messages of this drop that are still to come
    const double mean_drop = (1 + model.longest_drop) / 2.0;
    std::vector<StreamEntry> result;
    for (const StreamEntry& entry : entries) {
        const double share = rate[entry.kind];
        int& left = dropping[entry.kind];
        // Drops of mean length m begin with probability p such that m p / (m p + 1 - p) = share.
        if (share > 0 && left == 0 && random.uniform() < share / (share + mean_drop * (1 - share)))
            left = 1 + random.below(model.longest_drop);
        if (left > 0) {
            --left;
            continue;
        }
        result.push_back(entry);
        if (model.duplicate_rate > 0 && random.uniform() < model.duplicate_rate)
            result.push_back(entry);
    }
    return result;
}

}  // namespace vio
