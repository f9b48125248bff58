#include "libvio/simulation/tracks.h"

#include <algorithm>

namespace vio {
namespace {

struct Track {
    FeatureId id;
    Eigen::Vector3d followed_W;  ///< the point that the tracker follows now
    Eigen::Vector2d drift_px = Eigen::Vector2d::Zero();
    Eigen::Vector2d uv_px = Eigen::Vector2d::Zero();  ///< true place in the newest image
    int images = 0;
};

class TrackSimulator {
 public:
    TrackSimulator(const Scene& scene, const Camera& camera, const std::vector<Pose>& path,
                   const TrackModel& model, Random& random)
        : scene_(scene), camera_(camera), path_(path), model_(model), random_(random) {}

    void advance(TimeNs t, size_t image_idx) {
        T_W_C_ = path_[image_idx];
        keep_visible();
        if (static_cast<int>(tracks_.size()) < model_.fewest) extract();
        observe(t);
    }

    SimulatedTracks take() { return std::move(result_); }

 private:
    std::optional<Eigen::Vector3d> surface_at(const Eigen::Vector2d& uv_px,
                                              const Pose& T_W_C) const {
        const auto ray = camera_.ray(uv_px);
        if (!ray) return std::nullopt;
        const Eigen::Vector3d origin = T_W_C * ray->origin;
        const Eigen::Vector3d direction = T_W_C.R * ray->direction;
        const auto hit = scene_.cast(origin, direction);
        if (!hit) return std::nullopt;
        return Eigen::Vector3d(origin + hit->distance * direction);
    }

    /// Where a point is seen, nothing if outside the image or hidden.
    std::optional<Eigen::Vector2d> seen_from(const Pose& T_W_C, const Eigen::Vector3d& p_W) const {
        const auto uv = camera_.project(T_W_C.inverse() * p_W);
        if (!uv || !camera_.inside_image(*uv, model_.border_px)) return std::nullopt;
        const auto surface = surface_at(*uv, T_W_C);
        const double tolerance = 1e-3 + 2e-3 * (p_W - T_W_C.p).norm();
        if (!surface || (*surface - p_W).norm() > tolerance) return std::nullopt;
        return uv;
    }
    std::optional<Eigen::Vector2d> seen(const Eigen::Vector3d& p_W) const {
        return seen_from(T_W_C_, p_W);
    }

    /// Whether a point is in sight in the share of all images that is asked for.
    bool lasts(const Eigen::Vector3d& p_W) const {
        double misses = (1 - model_.lasting) * static_cast<double>(path_.size());
        return model_.lasting <= 0 ||
               std::all_of(path_.begin(), path_.end(), [&](const Pose& T_W_C) {
                   return seen_from(T_W_C, p_W) || --misses > -1e-6;
               });
    }

    void keep_visible() {
        std::erase_if(tracks_, [&](Track& track) {
            if (model_.longest > 0 && track.images >= model_.longest) return true;
            const auto uv = seen(track.followed_W);
            if (!uv && model_.refind) lost_.push_back(track);
            if (!uv) return true;
            if (model_.loss_rate > 0 && random_.uniform() < model_.loss_rate) return true;
            track.uv_px = *uv;
            return false;
        });
    }

    bool full() const { return static_cast<int>(tracks_.size()) >= model_.most; }

    bool crowded(const Eigen::Vector2d& uv_px) const {
        return std::any_of(tracks_.begin(), tracks_.end(), [&](const Track& t) {
            return (t.uv_px - uv_px).norm() < model_.spacing_px;
        });
    }

    void take_up_lost() {
        std::erase_if(lost_, [&](Track& track) {
            if (full()) return false;
            const auto uv = seen(track.followed_W);
            if (!uv || crowded(*uv)) return false;
            track.uv_px = *uv;
            tracks_.push_back(track);
            return true;
        });
    }

    void extract() {
        const double w = camera_.width() - 1 - 2 * model_.border_px;
        const double h = camera_.height() - 1 - 2 * model_.border_px;
        take_up_lost();
        const int attempts = (model_.lasting > 0 ? 1000 : 20) * model_.most;
        for (int i = 0; i < attempts && !full(); ++i) {
            const double u = random_.uniform(), v = random_.uniform();
            const Eigen::Vector2d uv(model_.border_px + w * u, model_.border_px + h * v);
            if (crowded(uv)) continue;
            const auto point = surface_at(uv, T_W_C_);
            if (!point || !seen(*point) || !lasts(*point)) continue;
            Track track{next_id_++, *point};
            track.uv_px = uv;
            result_.points_W.emplace(track.id, *point);
            tracks_.push_back(track);
        }
    }

    void jump(Track& track) {
        const Eigen::Vector2d uv = track.uv_px + model_.mistrack_px * random_.normal2();
        const auto point = surface_at(uv, T_W_C_);
        if (!point || !seen(*point)) return;
        track.followed_W = *point;
        track.uv_px = uv;
        result_.mistracked.push_back(track.id);
    }

    void observe(TimeNs t) {
        FeatureFrame frame{t, {}};
        for (Track& track : tracks_) {
            const bool first = track.images == 0;
            if (!first && model_.mistrack_rate > 0 && random_.uniform() < model_.mistrack_rate)
                jump(track);
            if (!first && model_.drift_px > 0)
                track.drift_px += model_.drift_px * random_.normal2();
            FeatureObservation observation;
            observation.feature_id = track.id;
            observation.uv_px = track.uv_px + track.drift_px + model_.noise_px * random_.normal2();
            if (model_.outlier_rate > 0 && random_.uniform() < model_.outlier_rate)
                observation.uv_px += model_.outlier_px * random_.normal2();
            frame.features.push_back(observation);
            ++track.images;
        }
        result_.frames.push_back(std::move(frame));
    }

    const Scene& scene_;
    const Camera& camera_;
    const std::vector<Pose>& path_;
    const TrackModel& model_;
    Random& random_;
    Pose T_W_C_;
    std::vector<Track> tracks_, lost_;
    FeatureId next_id_ = 0;
    SimulatedTracks result_;
};

}  // namespace

void TrackModel::describe(OptionSet& set) {
    set.add("most", &most, "-", {0, 1e5}, "features after extraction");
    set.add("fewest", &fewest, "-", {0, 1e5}, "with fewer in sight, new ones are extracted");
    set.add("spacing", &spacing_px, "px", {0, 1e4}, "least distance of new features");
    set.add("border", &border_px, "px", {0, 1e4}, "features this near the edge are lost");
    set.add("noise", &noise_px, "px", {0, 100}, "isotropic noise, 1 sigma per axis");
    set.add("drift", &drift_px, "px", {0, 100}, "random walk per image and axis, 1 sigma");
    set.add("loss_rate", &loss_rate, "-", {0, 1}, "probability of losing a feature, per image");
    set.add("refind", &refind,
            "features that were lost and are in sight again are taken up, by their number, before "
            "new ones: as where tracks are corrected by hand");
    set.add("lasting", &lasting, "-", {0, 1},
            "share of all images in which a feature must be in sight to be picked: as a person "
            "does who looks at the whole sequence first");
    set.add("longest", &longest, "images", {0, 1e6},
            "length after which a feature is lost; 0: none");
    set.add("mistrack_rate", &mistrack_rate, "-", {0, 1}, "probability of a jump, per observation");
    set.add("mistrack_size", &mistrack_px, "px", {0, 1e4}, "size of a jump, 1 sigma per axis");
    set.add("outlier_rate", &outlier_rate, "-", {0, 1},
            "probability of a gross error of one observation");
    set.add("outlier_size", &outlier_px, "px", {0, 1e4}, "its size, 1 sigma per axis");
}

SimulatedTracks simulate_tracks(const Scene& scene, const Camera& camera,
                                const std::vector<TimeNs>& times, const std::vector<Pose>& T_W_C,
                                const TrackModel& model, Random& random) {
    TrackSimulator simulator(scene, camera, T_W_C, model, random);
    for (size_t i = 0; i < times.size(); ++i) simulator.advance(times[i], i);
    return simulator.take();
}

}  // namespace vio
