#include "common/dds/cdr.h"

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastcdr/exceptions/Exception.h>

#include <concepts>
#include <type_traits>

#include "common/dds/checks.h"
#include "common/version.h"

namespace soda::dds {

using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

namespace {

constexpr std::size_t kEncapsulation = 4;  // bytes

// Fast CDR reads from buffers that are not const.
FastBuffer reading(std::span<const std::byte> bytes) {
  return FastBuffer(const_cast<char*>(reinterpret_cast<const char*>(bytes.data())), bytes.size());
}

template <class T>
constexpr bool kVersioned = std::same_as<T, wire::Session> || std::same_as<T, wire::Join>;

// Another version's layout cannot be relied on, only that it begins with its version.
template <class T>
bool is_of_other_version(std::span<const std::byte> bytes, T& out) {
  if constexpr (kVersioned<T>) {
    FastBuffer buffer = reading(bytes);
    Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
    cdr.read_encapsulation();
    std::uint32_t protocol = 0;
    cdr >> protocol;
    if (protocol != kProtocolVersion) {
      out = T();
      out.protocol(protocol);
      return true;
    }
  }
  return false;
}

template <class T>
void take_apart(std::span<const std::byte> bytes, T& out) {
  FastBuffer buffer = reading(bytes);
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.read_encapsulation();
  out.deserialize(cdr);
}

template <class T>
bool lengths_are_sane(std::span<const std::byte> bytes) {
  FastBuffer buffer = reading(bytes);
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.read_encapsulation();
  return lengths_fit<T>(cdr);
}

}  // namespace

template <class T>
std::vector<std::byte> encode(const T& sample) {
  std::vector<std::byte> bytes(T::getCdrSerializedSize(sample) + kEncapsulation);
  FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  Cdr cdr(buffer, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  cdr.serialize_encapsulation();
  sample.serialize(cdr);
  bytes.resize(cdr.getSerializedDataLength());
  return bytes;
}

template <class T>
std::string decode(std::span<const std::byte> bytes, T& out) {
  if (bytes.size() < kEncapsulation) return "truncated";
  try {
    if (is_of_other_version(bytes, out)) return "";
    if (!lengths_are_sane<T>(bytes)) return "a length beyond the end";
    take_apart(bytes, out);
  } catch (const eprosima::fastcdr::exception::Exception&) {
    return "truncated or malformed";
  } catch (const std::exception& e) {
    return std::string("malformed: ") + e.what();
  }
  return problem(out);
}

#define SODA_WIRE_TYPE(T)                                          \
  template std::vector<std::byte> encode<wire::T>(const wire::T&); \
  template std::string decode<wire::T>(std::span<const std::byte>, wire::T&);
SODA_WIRE_TYPE(Session)
SODA_WIRE_TYPE(SceneChunk)
SODA_WIRE_TYPE(Join)
SODA_WIRE_TYPE(Admission)
SODA_WIRE_TYPE(Control)
SODA_WIRE_TYPE(Request)
SODA_WIRE_TYPE(Answer)
SODA_WIRE_TYPE(LogEntry)
SODA_WIRE_TYPE(Border)
SODA_WIRE_TYPE(Status)
SODA_WIRE_TYPE(Digests)
SODA_WIRE_TYPE(StateChunk)
SODA_WIRE_TYPE(Poses)
SODA_WIRE_TYPE(Transforms)
SODA_WIRE_TYPE(Transfer)
SODA_WIRE_TYPE(Lack)
#undef SODA_WIRE_TYPE

}  // namespace soda::dds
