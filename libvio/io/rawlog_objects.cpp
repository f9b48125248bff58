#include "libvio/io/rawlog_objects.h"

#include <mrpt/serialization/CArchive.h>

#include <cstdint>
#include <iostream>
#include <list>
#include <new>
#include <stdexcept>
#include <vector>

#include "libvio/io/feature_observation.h"
#include "libvio/io/foreign_input.h"
#include "libvio/io/text.h"

namespace vio {
namespace {

// The innermost message of an exception of MRPT, which comes as a report of several lines.
std::string mrpt_reason(const std::string& report) {
    constexpr std::string_view kMark = "Message:";
    const auto mark = report.rfind(kMark);
    if (mark == std::string::npos) return one_line(report).substr(0, 160);
    const std::string message = report.substr(mark + kMark.size());
    return one_line(message.substr(0, message.find("\nLocation"))).substr(0, 160);
}

// Where a name in the file is that of an abstract class, MRPT complains on standard error and goes
// on without an object. From here on it throws. (That these names are registered anew it would also
// tell, hence the silence.)
bool refuse_abstract_classes() {
    static std::list<mrpt::rtti::TRuntimeClassId> refused;  // MRPT keeps addresses
    std::streambuf* const error_output = std::cerr.rdbuf(nullptr);
    for (const auto* known : mrpt::rtti::getAllRegisteredClasses()) {
        if (known->ptrCreateObject) continue;
        const std::string name = known->className;
        refused.push_back(*known);
        refused.back().ptrCreateObject = [name]() -> std::shared_ptr<mrpt::rtti::CObject> {
            throw std::runtime_error("an object of class " + name + ", which is abstract");
        };
        mrpt::rtti::registerClassCustomName(refused.back().className, &refused.back());
    }
    std::cerr.rdbuf(error_output);
    std::cerr.clear();
    return true;
}

const std::string& known_as_none_other(const std::string& file) {
    refuse_foreign_input(file);
    return file;
}

}  // namespace

RawlogObjects::RawlogObjects(const std::string& file) : input_(known_as_none_other(file)) {
    register_mrpt_classes();
    [[maybe_unused]] static const bool done = refuse_abstract_classes();
}

mrpt::serialization::CSerializable::Ptr RawlogObjects::next() {
    try {
        if (input_.at_end()) {
            if (count_ == 0) throw InputError(input_.file() + ": is empty; expected a rawlog");
            return nullptr;
        }
        auto archive = mrpt::serialization::archiveFrom(input_);
        auto object = archive.ReadObject();
        if (!object) throw std::runtime_error("a null object");
        ++count_;
        return object;
    } catch (const InputError&) {
        throw;
    } catch (const std::bad_alloc&) {  // of a length that was damaged
        throw failure("it asks for more memory than there is");
    } catch (const std::exception& reason) {
        throw failure(input_.failure().empty() ? mrpt_reason(reason.what()) : input_.failure());
    }
}

void write_object(const mrpt::serialization::CSerializable& object, GzOutput& out) {
    std::vector<std::uint8_t> bytes;
    mrpt::serialization::ObjectToOctetVector(&object, bytes);
    out.Write(bytes.data(), bytes.size());
}

InputError RawlogObjects::error(const std::string& problem) const {
    return InputError(input_.file() + " (object " + std::to_string(count_) + "): " + problem);
}

InputError RawlogObjects::failure(const std::string& reason) const {
    if (count_ == 0)
        return InputError(input_.file() + ": is not an MRPT rawlog, or its very beginning is " +
                          "damaged (" + reason +
                          "); what rawlogs can be made of: vio-slam import --help");
    return InputError(input_.file() + " (after object " + std::to_string(count_) + ", byte " +
                      std::to_string(input_.position()) + " of the content): " + reason +
                      "; what stands before is read, record or convert the file again");
}

}  // namespace vio
