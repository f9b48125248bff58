// Whether the motion is known: lost, blind, contradicted.
#include <cstdio>

#include "libvio/recursive/body_frame.h"
#include "libvio/recursive/iekf_impl.h"

namespace vio {

namespace {

constexpr int kMaxBadImages = 3;   // consecutive, then all landmarks are
constexpr int kJudgedSights = 30;  // of the judged images, if their share is to count
// Of an image's correction of scale, in its standard deviations: what is more, of which chance
// makes one in two million, is no error of first order.
constexpr double kMostOfScale = 5;
// What is added to the core's uncertainty when images have contradicted it.
constexpr double kLostRotation = 0.1, kLostPosition = 1.0, kLostVelocity = 1.0;

}  // namespace

void Iekf::Impl::judge(TimeNs t) {
    bad_images = contradicted && used < options.min_features ? bad_images + 1 : 0;
    if (bad_images == 1) log(t, "most points contradict the state; coasting");
    if (bad_images == kMaxBadImages) {
        log(t, "points given up");
        give_up(std::vector<bool>(state->landmarks().size(), true));
        window.clear();
    }
    if (used >= options.min_features) last_good = t;
    const bool unsure = known_velocity() > velocity_limit(options.lost_velocity_sigma);
    const bool now_lost = unseen(t) || unsure || abandoned || after_gap;
    const auto why = [&] { return velocity_known(options.lost_velocity_sigma); };
    if (now_lost != lost)
        log(t, !now_lost   ? "tracking found again"
               : after_gap ? "tracking lost: images were missing"
               : unseen(t)
                   ? "tracking lost: fewer than " + std::to_string(options.min_features) +
                         " points used for " + std::to_string(options.lost_after_seconds) + " s"
                   : "tracking lost: " + why());
    lost = now_lost;
    if (!restarts()) return;
    const bool scale_wrong = scale_correction > kMostOfScale;
    if (restarting && !abandoned && !lost && !scale_wrong) return recovered(t);
    if (!abandoned && (contradicts() || scale_wrong)) {
        abandon(t, contradicts() ? "most points have contradicted the state for a while"
                                 : scale_contradicted());
        state->inflate(state->find_clone(image_idx), kLostRotation, kLostPosition, kLostVelocity);
    } else if (unsure && !restarting) {
        restart(t, why());
    }
}

// Coasting without points can make the state so uncertain that updates would be linearised far from
// the truth, and believe in their errors.
void Iekf::Impl::abandon_if_blind(TimeNs t) {
    if (restarts() && !abandoned && unseen(t) &&
        known_velocity() > velocity_limit(options.blind_velocity_sigma))
        abandon(t, "no points in sight, " + velocity_known(options.blind_velocity_sigma));
}

// From now on the state is not updated, until there is a new start.
void Iekf::Impl::abandon(TimeNs t, const std::string& why) {
    if (!restarting) restart(t, why);
    abandoned = lost = true;
    give_up(std::vector<bool>(state->landmarks().size(), true));
    window.clear();
}

std::string Iekf::Impl::velocity_known(double limit) const {
    char text[160];
    std::snprintf(text, sizeof text, "velocity known to %.2g m/s, limit %.2g m/s", known_velocity(),
                  velocity_limit(limit));
    return text;
}

std::string Iekf::Impl::scale_contradicted() const {
    char text[160];
    std::snprintf(text, sizeof text, "scale was to be corrected by %.3g sigma, limit %.3g",
                  scale_correction, kMostOfScale);
    return text;
}

// Standard deviation of the velocity, as the IMU feels it [m/s].
double Iekf::Impl::known_velocity() const {
    if (!use_imu) return 0;
    const CoreState& core = state->core();
    return velocity_sigma(core.T_W_I.R, core.v_W, state->core_covariance());
}

double Iekf::Impl::velocity_limit(double sigma) const {
    return options.velocity_limit(sigma, state->core().v_W.norm());
}

// Whether most landmarks of the last images have failed the gate.
bool Iekf::Impl::contradicts() {
    int all = 0, passed = 0;
    for (const Sights& image : judged) {
        all += image.known;
        passed += image.passed;
    }
    return all >= kJudgedSights && passed < kBadShare * all;
}

}  // namespace vio
