#include "libvio/simulation/export.h"

#include <cmath>
#include <filesystem>
#include <future>
#include <sstream>

#include "libvio/base/errors.h"
#include "libvio/io/calibration_file.h"
#include "libvio/io/rawlog_writer.h"
#include "libvio/io/text.h"
#include "libvio/io/trajectory_io.h"

namespace vio {
namespace {

void append(std::ostream& out, const Eigen::Vector3d& v) {
    for (int i = 0; i < 3; ++i) out << "," << format(v[i]);
}

void write_states(const Simulation& simulation, const std::string& file) {
    std::ostringstream out;
    out << "# Truth at the images. v: velocity of the body in W [m/s]; bg, ba: biases of the gyro "
           "[rad/s] and the accelerometer [m/s^2] in the IMU frame\n"
           "# t_s,vx,vy,vz,bgx,bgy,bgz,bax,bay,baz\n";
    for (const StateEstimate& state : simulation.truth()) {
        out << format_seconds(state.t);
        append(out, state.v_W);
        append(out, state.gyro_bias);
        append(out, state.accel_bias);
        out << "\n";
    }
    write_text(file, out.str());
}

void write_points(const Simulation& simulation, const std::string& file) {
    std::ostringstream out;
    out << "# True points of the feature tracks in W [m]\n# feature_id,x,y,z\n";
    for (const auto& [id, p_W] : simulation.tracks().points_W) {
        out << id;
        append(out, p_W);
        out << "\n";
    }
    write_text(file, out.str());
}

void write_odometry(const Simulation& simulation, const std::string& file) {
    std::ostringstream out;
    out << "# Truth at the odometry messages: x, y [m], yaw [rad] of B from its first pose, on the "
           "ground; slipping: 1 while the wheels spin\n# t_s,x,y,yaw,slipping\n";
    const SimulatedOdometry& odometry = simulation.odometry();
    for (size_t i = 0; i < odometry.messages.size(); ++i) {
        const Pose& pose = odometry.truth[i];
        out << format_seconds(odometry.messages[i].t) << "," << format(pose.p.x()) << ","
            << format(pose.p.y()) << "," << format(std::atan2(pose.R(1, 0), pose.R(0, 0))) << ","
            << odometry.slipping[i] << "\n";
    }
    write_text(file, out.str());
}

void write_gps(const Simulation& simulation, const std::string& file) {
    std::ostringstream out;
    out << "# Truth at the GPS fixes: position of B in W (east, north, up) [m]; error of the fix "
           "[m]; changed: 1 where other satellites came into use\n"
           "# t_s,x,y,z,error_x,error_y,error_z,changed\n";
    const SimulatedGps& gps = simulation.gps();
    for (size_t i = 0; i < gps.messages.size(); ++i) {
        out << format_seconds(gps.messages[i].t);
        append(out, gps.truth_enu[i]);
        append(out, gps.error_enu[i]);
        out << "," << gps.satellites_changed[i] << "\n";
    }
    write_text(file, out.str());
}

// The images of the stream in its order, each drawn while the one before is written.
class ImagesAhead {
 public:
    explicit ImagesAhead(const Simulation& simulation) : simulation_(simulation) {
        if (!simulation.options().render) return;
        for (const StreamEntry& entry : simulation.stream())
            if (entry.kind == StreamEntry::Kind::kImage) order_.push_back(entry.index);
        draw_next();
    }

    cv::Mat take() {
        const cv::Mat image = drawn_.get();
        draw_next();
        return image;
    }

 private:
    void draw_next() {
        if (next_ == order_.size()) return;
        drawn_ = std::async(std::launch::async,
                            [this, index = order_[next_++]] { return simulation_.image(index); });
    }

    const Simulation& simulation_;
    std::vector<int> order_;
    size_t next_ = 0;
    std::future<cv::Mat> drawn_;
};

void write_image(const Simulation& simulation, int image_idx, ImagesAhead& images,
                 RawlogWriter& writer) {
    if (simulation.options().render)
        writer.write(ImageMessage{simulation.image_times()[image_idx], images.take()});
    if (simulation.options().tracks) writer.write(simulation.tracks().frames[image_idx]);
}

void write_rawlog(const Simulation& simulation, const std::string& file,
                  const std::function<void(double)>& progress) {
    RawlogWriter writer(file, simulation.stated_rig());
    ImagesAhead images(simulation);
    const double count = static_cast<double>(simulation.image_times().size());
    for (const StreamEntry& entry : simulation.stream()) {
        switch (entry.kind) {
            case StreamEntry::Kind::kImu:
                writer.write(simulation.imu()[entry.index]);
                break;
            case StreamEntry::Kind::kOdometry:
                writer.write(simulation.odometry().messages[entry.index]);
                break;
            case StreamEntry::Kind::kGps:
                writer.write(simulation.gps().messages[entry.index]);
                break;
            case StreamEntry::Kind::kImage:
                write_image(simulation, entry.index, images, writer);
                if (progress) progress((entry.index + 1) / count);
        }
    }
    writer.finish();
}

}  // namespace

void write_simulation(const Simulation& simulation, const std::string& rawlog_file,
                      const std::function<void(double)>& progress) {
    const std::filesystem::path path(rawlog_file);
    if (path.extension() != ".rawlog")
        throw InputError(rawlog_file + ": not the name of a rawlog; let it end in .rawlog");
    const auto beside = [&](const char* ending) {
        return std::filesystem::path(path).replace_extension(ending).string();
    };
    std::vector<TimedPose> poses;
    for (const StateEstimate& state : simulation.truth()) poses.push_back({state.t, state.T_W_B});
    write_tum(beside(".truth.tum"), poses, "T_W_B, ground truth");
    write_states(simulation, beside(".truth_states.csv"));
    if (simulation.options().tracks) write_points(simulation, beside(".truth_points.csv"));
    if (simulation.options().odometry.make)
        write_odometry(simulation, beside(".truth_odometry.csv"));
    if (simulation.options().gps.make) write_gps(simulation, beside(".truth_gps.csv"));
    if (calibration_text(simulation.stated_rig()) != calibration_text(simulation.rig()))
        write_text(beside(".truth_calibration.ini"), calibration_text(simulation.rig()));
    write_rawlog(simulation, rawlog_file, progress);
}

}  // namespace vio
