// The project's own observation class, as it stands in an archive.
#include <mrpt/io/CMemoryStream.h>
#include <mrpt/serialization/CArchive.h>

#include <stdexcept>

#include "libvio/io/feature_observation.h"
#include "libvio/io/mrpt_conversions.h"
#include "libvio/io/sensors.h"
#include "tests/fuzz/fuzz_file.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vio;
    register_mrpt_classes();
    mrpt::io::CMemoryStream stream(data, size);
    auto archive = mrpt::serialization::archiveFrom(stream);
    CObservationFeatures observation;
    try {
        archive.ReadObject(&observation);
    } catch (const std::exception&) {
        return 0;  // RawlogObjects makes an InputError of it
    }
    fuzz::expect_result_or_line([&] {
        Sensors sensors;
        sensors.see(observation, {});
        to_message(observation, sensors, {});
    });
    return 0;
}
