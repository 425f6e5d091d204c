// What comes over DDS and is no proper sample is refused at the door, counted, and nothing else happens.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "common/dds/participant.h"
#include "tests/distributed/dds_test_support.h"

namespace soda::dds {
namespace {

using namespace std::chrono_literals;

NetworkOptions network() {
  test::use_transports_within_process();
  return {};
}

// A type with the name of Border that sends whatever bytes it is given.
struct Raw {
  std::vector<std::byte> bytes;
};
class RawType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  RawType() {
    setName("soda::wire::Border");
    m_typeSize = 1 << 16;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    const auto& bytes = static_cast<Raw*>(data)->bytes;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    return true;
  }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t*, void*) override { return true; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Raw*>(data)->bytes.size()); };
  }
  void* createData() override { return new Raw; }
  void deleteData(void* data) override { delete static_cast<Raw*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};
class RawWriter : public WriterBase {
 public:
  RawWriter(Participant& participant, const Topic& topic) : WriterBase(participant, topic, new RawType, nullptr) {}
  bool write(const Raw& raw) { return write_raw(&raw); }
};

TEST(Malformed, SamplesAreRefusedCountedAndForgotten) {
  const std::string session = test::unique_session();
  Participant sender(network(), session, "sender"), receiver(network(), session, "receiver");
  std::atomic<int> good{0};
  const std::uint64_t refused_before = refusals().count();
  const Reader<wire::Border> reader(receiver, border_topic(0, 1), [&](wire::Border&& sample, const WriterKey&) {
    EXPECT_EQ(sample.payload().size(), 3u);
    ++good;
  });
  RawWriter writer(sender, border_topic(0, 1));
  for (int i = 0; i < 1000 && !writer.matched(); ++i) std::this_thread::sleep_for(10ms);
  ASSERT_TRUE(writer.matched());

  wire::Border proper;
  proper.to(1);
  proper.payload({1, 2, 3});
  const std::vector<std::byte> bytes = encode(proper);
  std::vector<std::byte> endless = bytes, stranger = bytes;
  for (std::size_t i = 12; i < 16; ++i) endless[i] = std::byte{0xff};  // the payload's length
  for (std::size_t i = 4; i < 8; ++i) stranger[i] = std::byte{0xff};   // from
  const std::vector<std::byte> cut(bytes.begin(), bytes.begin() + 9), stub(2), noise(100, std::byte{0xa5});
  constexpr int kRounds = 50;
  for (int round = 0; round < kRounds; ++round)
    for (const auto& each : {bytes, endless, stranger, cut, stub, noise}) {
      int attempts = 0;
      while (!writer.write({each}) && ++attempts < 1000) {  // the history is short
      }
      ASSERT_LT(attempts, 1000);
    }
  for (int i = 0; i < 1000 && refusals().count() < refused_before + 5 * kRounds; ++i) std::this_thread::sleep_for(10ms);
  EXPECT_EQ(refusals().count(), refused_before + 5 * kRounds);
  EXPECT_EQ(good.load(), kRounds);
}

}  // namespace
}  // namespace soda::dds
