#include "common/dds/participant.h"

#include <fastdds/rtps/participant/ParticipantDiscoveryInfo.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <condition_variable>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <iterator>
#include <map>
#include <mutex>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "common/dds/network_qos.h"
#include "common/dds/shm_cleanup.h"

namespace soda::dds {

namespace fdds = eprosima::fastdds::dds;
namespace frtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

Duration_t duration(double seconds) {
  return {static_cast<std::int32_t>(seconds), static_cast<std::uint32_t>(std::fmod(seconds, 1) * 1e9)};
}
Duration_t duration(Millis ms) { return duration(static_cast<double>(ms.count()) * 1e-3); }

// What Fast DDS has to say goes where our own messages go.
class ToSpdlog final : public fdds::LogConsumer {
  void Consume(const fdds::Log::Entry& entry) override {
    const auto level = entry.kind == fdds::Log::Kind::Error ? spdlog::level::warn : spdlog::level::debug;
    spdlog::log(level, "Fast DDS: {}: {}", entry.context.category, entry.message);
  }
};

void route_log_once() {
  static std::once_flag once;
  std::call_once(once, [] {
    fdds::Log::ClearConsumers();
    fdds::Log::RegisterConsumer(std::make_unique<ToSpdlog>());
    fdds::Log::SetVerbosity(fdds::Log::Kind::Error);
  });
}

// The same for the QoS of writers and of readers.
template <class Qos>
void set_flow(const Flow& flow, Qos& qos) {
  qos.reliability().kind = flow.reliable ? fdds::RELIABLE_RELIABILITY_QOS : fdds::BEST_EFFORT_RELIABILITY_QOS;
  qos.reliability().max_blocking_time = duration(flow.write_at_most);
  qos.durability().kind = flow.late_joiners ? fdds::TRANSIENT_LOCAL_DURABILITY_QOS : fdds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = flow.keep_last > 0 ? fdds::KEEP_LAST_HISTORY_QOS : fdds::KEEP_ALL_HISTORY_QOS;
  qos.history().depth = flow.keep_last > 0 ? flow.keep_last : 1;
  // All three explicitly: by default there are at most 10 instances.
  qos.resource_limits().max_samples = flow.max_samples;
  qos.resource_limits().max_instances = flow.max_instances;
  qos.resource_limits().max_samples_per_instance = flow.keep_last > 0 ? flow.keep_last : flow.max_samples;
  qos.resource_limits().allocated_samples = std::min(4, flow.max_samples);
  qos.endpoint().history_memory_policy = frtps::DYNAMIC_REUSABLE_MEMORY_MODE;
  qos.data_sharing().off();
}

WriterKey key_of(const frtps::InstanceHandle_t& handle) {
  WriterKey key;
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = handle.value[i];
  return key;
}

// No exception may leave a handler: it would end the process from a thread of DDS.
template <class F>
void guarded(const F& handler) {
  try {
    handler();
  } catch (const std::exception& e) {
    spdlog::error("in a DDS handler: {}", e.what());
  }
}

}  // namespace

// Losing each other is not mutual: a process that others gave up (it stood still beyond its lease, say) may not have
// given them up, and then Fast DDS 2.9 takes what it told them of its endpoints for acknowledged and may never repeat
// it when they discover it again (seen in one of three pauses: no message comes through any more). So everybody
// publishes, in the user data of its participant, whom it has given up, with a number that grows as long as it has met
// that participant's endpoints not again; and who finds itself there with a new number announces all its endpoints
// anew.
struct Participant::Impl : fdds::DomainParticipantListener {
  std::string session;
  fdds::DomainParticipant* participant = nullptr;
  fdds::Publisher* publisher = nullptr;
  fdds::Subscriber* subscriber = nullptr;
  std::mutex mutex;  // guards the creation of topics, which a writer and a reader may share

  using Prefix = std::array<unsigned char, 12>;  // names a participant
  std::mutex losses_mutex;
  std::condition_variable_any losses_changed;
  struct Loss {
    std::uint32_t number = 0;
    bool back = false, writer = false, reader = false;  // what of it was discovered again
    bool healed() const { return writer && reader; }
  };
  std::map<Prefix, Loss> given_up;              // by this process
  std::map<Prefix, std::uint32_t> given_up_by;  // this process by others: the number at its last announcement
  bool tell_due = false, announce_due = false;
  int announcements = 0;
  std::jthread teller;  // DDS does not like to be asked for such things from its own callbacks

  ~Impl() override {
    teller = {};
    if (participant == nullptr) return;
    participant->set_listener(nullptr);
    participant->delete_contained_entities();
    fdds::DomainParticipantFactory::get_instance()->delete_participant(participant);
  }

  fdds::Topic* topic(const std::string& name, fdds::TypeSupport type) {
    const std::lock_guard lock(mutex);
    if (auto* known = dynamic_cast<fdds::Topic*>(participant->lookup_topicdescription(name))) return known;
    if (participant->register_type(type) != ReturnCode_t::RETCODE_OK)
      throw std::runtime_error("cannot register the DDS type " + type.get_type_name());
    fdds::Topic* made = participant->create_topic(name, type.get_type_name(), fdds::TOPIC_QOS_DEFAULT);
    if (made == nullptr) throw std::runtime_error("cannot make the DDS topic " + name);
    return made;
  }

  static Prefix prefix_of(const frtps::GUID_t& guid) {
    Prefix prefix;
    std::copy_n(guid.guidPrefix.value, prefix.size(), prefix.begin());
    return prefix;
  }

  void on_participant_discovery(fdds::DomainParticipant* self, frtps::ParticipantDiscoveryInfo&& info) override {
    using Info = frtps::ParticipantDiscoveryInfo;
    const Prefix who = prefix_of(info.info.m_guid);
    const std::lock_guard lock(losses_mutex);
    const auto loss = given_up.find(who);
    if (info.status == Info::DROPPED_PARTICIPANT) {
      if (given_up.size() >= kMostGivenUp && loss == given_up.end()) given_up.erase(given_up.begin());
      given_up[who] = {given_up[who].number + 1, false, false, false};
      tell_due = true;
    } else if (info.status == Info::REMOVED_PARTICIPANT) {
      given_up.erase(who);
      given_up_by.erase(who);
    } else {
      if (loss != given_up.end()) loss->second.back = true;
      const std::uint32_t number = number_of(self->guid(), info.info.m_userData);
      if (number > given_up_by[who]) {
        given_up_by[who] = number;
        announce_due = true;
      }
    }
    losses_changed.notify_one();
  }
  void on_publisher_discovery(fdds::DomainParticipant*, frtps::WriterDiscoveryInfo&& info) override {
    if (info.status == frtps::WriterDiscoveryInfo::REMOVED_WRITER) return;
    const std::lock_guard lock(losses_mutex);
    const auto loss = given_up.find(prefix_of(info.info.guid()));
    if (loss != given_up.end()) loss->second.writer = true;
  }
  void on_subscriber_discovery(fdds::DomainParticipant*, frtps::ReaderDiscoveryInfo&& info) override {
    if (info.status == frtps::ReaderDiscoveryInfo::REMOVED_READER) return;
    const std::lock_guard lock(losses_mutex);
    const auto loss = given_up.find(prefix_of(info.info.guid()));
    if (loss != given_up.end()) loss->second.reader = true;
  }

  // How often this process was given up by the participant with that user data: records of prefix and count.
  static std::uint32_t number_of(const frtps::GUID_t& guid, const std::vector<unsigned char>& user_data) {
    const auto& self = guid.guidPrefix.value;
    for (std::size_t i = 0; i + kLossBytes <= user_data.size(); i += kLossBytes) {
      if (!std::equal(std::begin(self), std::end(self), user_data.begin() + static_cast<std::ptrdiff_t>(i))) continue;
      std::uint32_t number = 0;
      std::memcpy(&number, user_data.data() + i + sizeof(Prefix), sizeof number);
      return number;
    }
    return 0;
  }

  void tell(const std::stop_token& stop) {
    std::unique_lock lock(losses_mutex);
    const auto due = [&] { return tell_due || announce_due; };
    while (!stop.stop_requested()) {
      bool half_back = false;  // whether anybody came back whose endpoints did not
      for (const auto& [who, loss] : given_up) half_back = half_back || (loss.back && !loss.healed());
      if (half_back) {
        if (!losses_changed.wait_for(lock, stop, kPatience, due) && !stop.stop_requested())
          for (auto& [who, loss] : given_up)
            if (loss.back && !loss.healed()) ++loss.number, tell_due = true;
      } else {
        losses_changed.wait(lock, stop, due);
      }
      const bool telling = std::exchange(tell_due, false), announcing = std::exchange(announce_due, false);
      const auto losses = given_up;
      lock.unlock();
      if (telling) tell_losses(losses);
      if (announcing) announce_anew();
      lock.lock();
    }
  }

  void tell_losses(const std::map<Prefix, Loss>& losses) const {
    std::vector<unsigned char> user_data;
    for (const auto& [who, loss] : losses) {
      user_data.insert(user_data.end(), who.begin(), who.end());
      const auto* bytes = reinterpret_cast<const unsigned char*>(&loss.number);
      user_data.insert(user_data.end(), bytes, bytes + sizeof loss.number);
    }
    fdds::DomainParticipantQos qos = participant->get_qos();
    qos.user_data().setValue(user_data);
    if (participant->set_qos(qos) != ReturnCode_t::RETCODE_OK) spdlog::error("DDS does not take new user data");
  }

  void announce_anew() {
    // A further partition, which nobody else is in, changes no matching, but makes DDS tell of every endpoint again.
    spdlog::debug("others had lost this process; it announces itself anew");
    const std::string more = session + "/" + std::to_string(++announcements);
    fdds::PublisherQos publisher_qos = publisher->get_qos();
    publisher_qos.partition().clear();
    publisher_qos.partition().push_back(session.c_str());
    publisher_qos.partition().push_back(more.c_str());
    fdds::SubscriberQos subscriber_qos = subscriber->get_qos();
    subscriber_qos.partition() = publisher_qos.partition();
    if (publisher->set_qos(publisher_qos) != ReturnCode_t::RETCODE_OK ||
        subscriber->set_qos(subscriber_qos) != ReturnCode_t::RETCODE_OK)
      spdlog::error("DDS does not announce this process's endpoints again");
  }

  static constexpr std::size_t kLossBytes = sizeof(Prefix) + sizeof(std::uint32_t);
  static constexpr std::size_t kMostGivenUp = 64;
  static constexpr std::chrono::milliseconds kPatience{500};
};

Participant::Participant(const NetworkOptions& options, const std::string& session, const std::string& name)
    : impl_(std::make_unique<Impl>()) {
  route_log_once();
  impl_->session = session;
  fdds::DomainParticipantQos qos = network_qos(options);
  qos.name(name);
  std::unique_ptr<PortsLock> lock;
  if (options.shared_memory) {
    remove_stale_shm();
    lock = std::make_unique<PortsLock>();
    qos.wire_protocol().participant_id = fresh_participant_id(options.domain);
  }
  impl_->participant = fdds::DomainParticipantFactory::get_instance()->create_participant(
      options.domain, qos, impl_.get(), fdds::StatusMask::none());
  lock.reset();
  if (impl_->participant == nullptr)
    throw std::runtime_error("cannot join DDS domain " + std::to_string(options.domain) + " on interface " +
                             options.interface);
  fdds::PublisherQos publisher_qos;
  publisher_qos.partition().push_back(session.c_str());
  fdds::SubscriberQos subscriber_qos;
  subscriber_qos.partition().push_back(session.c_str());
  impl_->publisher = impl_->participant->create_publisher(publisher_qos);
  impl_->subscriber = impl_->participant->create_subscriber(subscriber_qos);
  if (impl_->publisher == nullptr || impl_->subscriber == nullptr)
    throw std::runtime_error("cannot make a DDS publisher and subscriber");
  impl_->teller = std::jthread([impl = impl_.get()](const std::stop_token& stop) { impl->tell(stop); });
}

Participant::~Participant() = default;

// ---- writers

struct WriterBase::Impl : fdds::DataWriterListener {
  fdds::Publisher* publisher = nullptr;
  fdds::DataWriter* writer = nullptr;
  MatchHandler on_match;
  std::atomic<int> readers{0};

  void on_publication_matched(fdds::DataWriter*, const fdds::PublicationMatchedStatus& status) override {
    readers.store(status.current_count);
    if (on_match) guarded([&] { on_match(status.current_count_change); });
  }
};

WriterBase::WriterBase(Participant& participant, const Topic& topic, fdds::TopicDataType* type, MatchHandler on_match)
    : impl_(std::make_unique<Impl>()) {
  fdds::DataWriterQos qos;
  set_flow(topic.flow, qos);
  qos.publish_mode().kind = fdds::SYNCHRONOUS_PUBLISH_MODE;
  qos.reliable_writer_qos().times.heartbeatPeriod = duration(kHeartbeat);
  qos.reliable_writer_qos().times.nackResponseDelay = duration(kAnswerDelay);
  impl_->publisher = participant.impl().publisher;
  impl_->on_match = std::move(on_match);
  fdds::Topic* entity = participant.impl().topic(topic.name, fdds::TypeSupport(type));
  impl_->writer = impl_->publisher->create_datawriter(entity, qos, impl_.get());
  if (impl_->writer == nullptr) throw std::runtime_error("cannot make a DDS writer of " + topic.name);
}

WriterBase::~WriterBase() {
  impl_->writer->set_listener(nullptr);
  impl_->publisher->delete_datawriter(impl_->writer);
}

WriterKey WriterBase::key() const { return key_of(impl_->writer->get_instance_handle()); }

bool WriterBase::matched() const { return impl_->readers.load() > 0; }

bool WriterBase::wait_acknowledged(std::chrono::milliseconds at_most) {
  return impl_->writer->wait_for_acknowledgments(duration(at_most)) == ReturnCode_t::RETCODE_OK;
}

bool WriterBase::write_raw(const void* sample) {
  return impl_->writer->write(const_cast<void*>(sample));  // serialised, not changed
}

// ---- readers

struct ReaderBase::Impl : fdds::DataReaderListener {
  fdds::Subscriber* subscriber = nullptr;
  fdds::DataReader* reader = nullptr;
  std::function<void(fdds::DataReader&)> on_data;
  MatchHandler on_match;

  void on_data_available(fdds::DataReader* from) override {
    guarded([&] { on_data(*from); });
  }
  void on_subscription_matched(fdds::DataReader*, const fdds::SubscriptionMatchedStatus& status) override {
    if (on_match) guarded([&] { on_match(status.current_count_change); });
  }
};

ReaderBase::ReaderBase(Participant& participant, const Topic& topic, fdds::TopicDataType* type,
                       std::function<void(fdds::DataReader&)> on_data, MatchHandler on_match)
    : impl_(std::make_unique<Impl>()) {
  fdds::DataReaderQos qos;
  set_flow(topic.flow, qos);
  qos.reliable_reader_qos().times.heartbeatResponseDelay = duration(kAnswerDelay);
  impl_->subscriber = participant.impl().subscriber;
  impl_->on_data = std::move(on_data);
  impl_->on_match = std::move(on_match);
  fdds::Topic* entity = participant.impl().topic(topic.name, fdds::TypeSupport(type));
  impl_->reader = impl_->subscriber->create_datareader(entity, qos, impl_.get());
  if (impl_->reader == nullptr) throw std::runtime_error("cannot make a DDS reader of " + topic.name);
}

ReaderBase::~ReaderBase() {
  impl_->reader->set_listener(nullptr);
  impl_->subscriber->delete_datareader(impl_->reader);
}

bool ReaderBase::take_raw(fdds::DataReader& reader, void* received, WriterKey& writer, bool& valid) {
  fdds::SampleInfo info;
  if (reader.take_next_sample(received, &info) != ReturnCode_t::RETCODE_OK) return false;
  valid = info.valid_data;
  writer = key_of(info.publication_handle);
  return true;
}

#define SODA_WIRE_NAME(T)            \
  template <>                        \
  const char* wire_name<wire::T>() { \
    return "soda::wire::" #T;        \
  }
SODA_WIRE_NAME(Session)
SODA_WIRE_NAME(SceneChunk)
SODA_WIRE_NAME(Join)
SODA_WIRE_NAME(Admission)
SODA_WIRE_NAME(Control)
SODA_WIRE_NAME(Request)
SODA_WIRE_NAME(Answer)
SODA_WIRE_NAME(LogEntry)
SODA_WIRE_NAME(Border)
SODA_WIRE_NAME(Status)
SODA_WIRE_NAME(Digests)
SODA_WIRE_NAME(StateChunk)
SODA_WIRE_NAME(Poses)
SODA_WIRE_NAME(Transforms)
SODA_WIRE_NAME(Transfer)
SODA_WIRE_NAME(Lack)
#undef SODA_WIRE_NAME

}  // namespace soda::dds
