#include "libvio/recursive/iekf.h"

namespace vio {

void IekfOptions::describe(OptionSet& options) {
    options.section("iekf");
    options.add("motion", &motion, {"imu_driven", "smooth"},
                "what moves the state between images: inertial readings, or the assumption of "
                "smooth motion with readings as measurements");
    options.add("consistency", &consistency, {"invariant", "none"},
                "how global position and yaw are kept from being observed");
    options.add("new_points", &new_points, {"clones", "paper"},
                "uncertainty of new points: from all recent cameras, or from the newest alone");
    options.add("sigma_px", &sigma_px, "px", {1e-3, 100},
                "standard deviation of a feature's position");
    options.add("max_iterations", &max_iterations, "", {1, 20}, "iterations of an image update");
    options.add("gate", &gate, "", {0.5, 0.999999},
                "probability that a correct feature passes the innovation gate");
    options.add(
        "start", &start, {"auto", "prefix", "rest"},
        "always from a prefix; from rest whenever the sensors are at rest; or (auto) from a prefix "
        "and, where that is impossible or the motion was lost, also from rest");
    options.add("prefix_images", &prefix_images, "images", {3, 1000},
                "images of the batch estimate that starts the filter");
    options.add("start_velocity_sigma", &start_velocity_sigma, "m/s", {1e-3, 100},
                "largest uncertainty of velocity, along the axes of the body, to start with");
    options.add("start_tilt_sigma", &start_tilt_sigma, "rad", {1e-4, 1},
                "largest uncertainty of the direction of gravity to start with");
    options.add("start_wanted_tilt", &start_wanted_tilt, "rad", {0, 1},
                "while the direction of gravity is less certain, the first start waits for more "
                "images, up to twice prefix_images");
    options.add("start_scale_sigma", &start_scale_sigma, "", {1e-3, 1},
                "largest uncertainty of the path's scale to start with, as a share");
    options.add(
        "camera_rotation_sigma", &camera_rotation_sigma, "rad", {0, 1},
        "imu_driven: uncertainty of the camera's attitude on the IMU, about each axis; it is "
        "estimated unless this, the next and time_offset_sigma are all 0: exact");
    options.add("camera_position_sigma", &camera_position_sigma, "m", {0, 10},
                "likewise of its position, along each axis");
    options.add("time_offset_sigma", &time_offset_sigma, "s", {0, 1},
                "likewise of the offset between the clocks of camera and IMU");
    options.add("imu_rotation_sigma", &imu_rotation_sigma, "rad", {0, 1},
                "uncertainty of the IMU's attitude on the body, about each axis: nothing tells of "
                "it, it is added to that of the output; 0: the body is where the IMU says");
    options.add("imu_position_sigma", &imu_position_sigma, "m", {0, 10},
                "likewise of its position, along each axis");
    options.add("clones", &clones, "images", {3, 60}, "earlier poses kept in the state");
    options.add("max_landmarks", &max_landmarks, "", {0, 1000}, "points kept in the state");
    options.add("lost_after", &lost_after, "images", {0, 1000},
                "a point leaves the state after so many images without it");
    options.add("new_point_sigma", &new_point_sigma, "", {1e-3, 1},
                "a point enters the state when its inverse distance is known to this share of what "
                "is usual");
    options.add("max_window_points", &max_window_points, "", {1, 1000},
                "points outside the state used at one image");
    options.add("angular_rate_variance", &angular_rate_variance, "(rad/s)^2/s", {1e-9, 1e15},
                "smooth motion: random walk of angular velocity");
    options.add("acceleration_variance", &acceleration_variance, "(m/s^2)^2/s", {1e-9, 1e15},
                "smooth motion: random walk of acceleration");
    options.add("image_rotation_variance", &image_rotation_variance, "rad^2/s", {1e-9, 1e6},
                "image-only: random walk of rotation");
    options.add("image_position_variance", &image_position_variance, "m^2/s", {1e-9, 1e6},
                "image-only: random walk of position");
    options.add("min_features", &min_features, "", {1, 1000},
                "with fewer features used for a while, tracking counts as lost");
    options.add("lost_after_seconds", &lost_after_seconds, "s", {0, 60}, "that while");
    options.add("lost_velocity_sigma", &lost_velocity_sigma, "m/s", {1e-3, 1e6},
                "imu_driven: with a less certain velocity tracking counts as lost, and a new start "
                "is looked for");
    options.add("blind_velocity_sigma", &blind_velocity_sigma, "m/s", {1e-3, 1e6},
                "imu_driven: with a less certain velocity after a time without points the state is "
                "not updated any more until there is a new start");
    options.add("usual_speed", &usual_speed, "m/s", {1e-2, 1e6},
                "up to this speed the three limits of velocity's uncertainty are as stated; beyond "
                "it they grow in proportion to the speed");
    options.add("message_window", &message_window, "s", {0, 10},
                "measurements may come late by this much");
    options.add("output", &output, {"images", "readings"},
                "a state at every image, or at every inertial reading too");
}

}  // namespace vio
