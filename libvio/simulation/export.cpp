#include "libvio/simulation/export.h"

#include <filesystem>
#include <sstream>

#include "libvio/base/errors.h"
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

void write_rawlog(const Simulation& simulation, const std::string& file,
                  const std::function<void(double)>& progress) {
    RawlogWriter writer(file, simulation.rig());
    const auto& imu = simulation.imu();
    const auto& times = simulation.image_times();
    size_t reading = 0;
    for (size_t i = 0; i < times.size(); ++i) {
        for (; reading < imu.size() && imu[reading].t <= times[i]; ++reading)
            writer.write(imu[reading]);
        if (simulation.options().render)
            writer.write(ImageMessage{times[i], simulation.image(static_cast<int>(i))});
        if (simulation.options().tracks) writer.write(simulation.tracks().frames[i]);
        if (progress) progress(static_cast<double>(i + 1) / static_cast<double>(times.size()));
    }
    for (; reading < imu.size(); ++reading) writer.write(imu[reading]);
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
    write_rawlog(simulation, rawlog_file, progress);
}

}  // namespace vio
