#include "libvio/io/feature_observation.h"

#include <mrpt/serialization/CArchive.h>

#include <algorithm>
#include <ostream>
#include <stdexcept>

namespace vio {

IMPLEMENTS_SERIALIZABLE(CObservationFeatures, CObservation, vio)

namespace {

// A damaged count must not ask for all memory at once: elements are read in blocks of this many.
constexpr std::size_t kBlock = 65536;

template <typename T>
void write_array(mrpt::serialization::CArchive& out, const T* values, std::size_t count) {
    if (count > 0) out.WriteBufferFixEndianness(values, count);
}

template <typename Element, typename Scalar>
void read_array(mrpt::serialization::CArchive& in, std::vector<Element>& values,
                std::size_t count) {
    constexpr std::size_t kScalars = sizeof(Element) / sizeof(Scalar);
    values.clear();
    while (values.size() < count) {
        const std::size_t begin = values.size(), more = std::min(kBlock, count - begin);
        values.resize(begin + more);
        auto* target = reinterpret_cast<Scalar*>(values.data() + begin);
        if (in.ReadBufferFixEndianness(target, more * kScalars) != more * kScalars * sizeof(Scalar))
            throw std::runtime_error("CObservationFeatures: the stream is cut off");
    }
}

}  // namespace

uint8_t CObservationFeatures::serializeGetVersion() const {
    return 0;
}

void CObservationFeatures::serializeTo(mrpt::serialization::CArchive& out) const {
    const std::size_t count = feature_ids.size();
    const bool shaped = !covariance_shapes.empty();
    if (u_px.size() != count || v_px.size() != count ||
        (shaped && covariance_shapes.size() != count))
        throw std::logic_error("CObservationFeatures: arrays differ in length");
    out << timestamp << sensorLabel << cameraPose << cameraParams;
    out << static_cast<std::uint32_t>(count) << shaped;
    write_array(out, feature_ids.data(), count);
    write_array(out, u_px.data(), count);
    write_array(out, v_px.data(), count);
    if (shaped) write_array(out, covariance_shapes.data()->data(), 3 * count);
}

void CObservationFeatures::serializeFrom(mrpt::serialization::CArchive& in,
                                         uint8_t serial_version) {
    if (serial_version != 0)
        throw std::runtime_error("CObservationFeatures: written by a newer version of vio-slam");
    in >> timestamp >> sensorLabel >> cameraPose >> cameraParams;
    std::uint32_t count = 0;
    std::uint8_t shaped = 0;  // a bool, which a damaged file may not hold
    in >> count >> shaped;
    read_array<std::int64_t, std::int64_t>(in, feature_ids, count);
    read_array<double, double>(in, u_px, count);
    read_array<double, double>(in, v_px, count);
    read_array<std::array<double, 3>, double>(in, covariance_shapes, shaped ? count : 0);
}

void CObservationFeatures::getDescriptionAsText(std::ostream& out) const {
    CObservation::getDescriptionAsText(out);
    out << "Homogeneous matrix for the camera pose in the vehicle frame:\n"
        << cameraPose.getHomogeneousMatrixVal<mrpt::math::CMatrixDouble44>() << cameraPose << "\n"
        << "Camera:\n"
        << cameraParams.dumpAsText() << "\n"
        << feature_ids.size() << " features (id: u v [px])\n";
    for (std::size_t i = 0; i < feature_ids.size(); ++i)
        out << "  " << feature_ids[i] << ": " << u_px[i] << " " << v_px[i] << "\n";
}

void register_mrpt_classes() {
    mrpt::rtti::registerClass(CLASS_ID(CObservationFeatures));
}

namespace {

// For programs that load this file as the module vio_mrpt_plugin. After the class's name above has
// been initialised, which MRPT_INITIALIZER does not wait for.
[[maybe_unused]] const bool kRegistered = (register_mrpt_classes(), true);

}  // namespace

}  // namespace vio
