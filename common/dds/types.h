// Gives the wire types to Fast DDS. Taking apart never fails for DDS: a sample that is refused arrives as a Received
// with the reason, because Fast DDS would leave it in the reader's history otherwise, and nothing but ours is to catch
// what a malformed sample throws.
#pragma once

#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/rtps/common/InstanceHandle.h>
#include <fastdds/rtps/common/SerializedPayload.h>

#include <cstring>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <functional>
#include <string>
#include <type_traits>

#include "common/dds/cdr.h"

namespace soda::dds {

template <class T>
struct Received {
  T sample;             // first: DDS hands out pointers to a Received where it takes a T
  std::string refusal;  // "" if the sample may be used
};

template <class T>
class WireType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  static_assert(std::is_standard_layout_v<Received<T>>, "a pointer to a Received is one to its sample");
  using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;
  using Handle = eprosima::fastrtps::rtps::InstanceHandle_t;

  explicit WireType(const char* name) {
    setName(name);
    m_typeSize = 4 + static_cast<std::uint32_t>(T::getMaxCdrSerializedSize());
    m_isGetKeyDefined = T::isKeyDefined();
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, Payload* payload) override {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->max_size);
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
    payload->encapsulation = CDR_LE;
    try {
      cdr.serialize_encapsulation();
      static_cast<const T*>(data)->serialize(cdr);
    } catch (const eprosima::fastcdr::exception::Exception&) {
      return false;
    }
    payload->length = static_cast<std::uint32_t>(cdr.getSerializedDataLength());
    return true;
  }

  bool deserialize(Payload* payload, void* data) override {
    auto* received = static_cast<Received<T>*>(data);
    received->refusal =
        decode(std::span(reinterpret_cast<const std::byte*>(payload->data), payload->length), received->sample);
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(T::getCdrSerializedSize(*static_cast<const T*>(data))) + 4; };
  }

  void* createData() override { return new Received<T>(); }
  void deleteData(void* data) override { delete static_cast<Received<T>*>(data); }

  bool getKey(void* data, Handle* handle, bool /*force_md5*/ = false) override {
    if (!m_isGetKeyDefined) return false;
    // All our keys are one integer of at most 16 bytes, for which DDS uses the big-endian bytes as they are.
    char bytes[16] = {};
    eprosima::fastcdr::FastBuffer buffer(bytes, sizeof bytes);
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::BIG_ENDIANNESS);
    static_cast<const T*>(data)->serializeKey(cdr);
    for (int i = 0; i < 16; ++i) handle->value[i] = static_cast<unsigned char>(bytes[i]);
    return true;
  }
};

}  // namespace soda::dds
