#include "common/dds/participant.h"

#include <arpa/inet.h>
#include <fastdds/rtps/attributes/ServerAttributes.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPFinder.h>
#include <fastrtps/utils/IPLocator.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <mutex>
#include <stdexcept>
#include <utility>

namespace soda::dds {

namespace fdds = eprosima::fastdds::dds;
namespace frtps = eprosima::fastrtps::rtps;
using eprosima::fastrtps::Duration_t;
using eprosima::fastrtps::types::ReturnCode_t;

namespace {

constexpr std::uint32_t kShmSegment = 16u << 20;   // bytes; by default 512 KiB, in which 1 MiB takes 12 ms, not 1.1 ms
constexpr std::uint32_t kSocketBuffer = 4u << 20;  // bytes
constexpr double kAnnouncePeriod = 1;              // s, at most; how long two that lost each other take to meet again

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

void set_transports(const NetworkOptions& options, fdds::DomainParticipantQos& qos) {
  using namespace eprosima::fastdds::rtps;
  qos.transport().use_builtin_transports = false;
  if (options.shared_memory) {
    auto shm = std::make_shared<SharedMemTransportDescriptor>();
    shm->segment_size(kShmSegment);
    qos.transport().user_transports.push_back(shm);
  }
  auto udp = std::make_shared<UDPv4TransportDescriptor>();
  udp->sendBufferSize = kSocketBuffer;
  udp->receiveBufferSize = kSocketBuffer;
  if (options.interface == "local") {
    udp->interfaceWhiteList.emplace_back("127.0.0.1");  // otherwise discovery goes out on every interface
  } else if (options.interface != "all") {
    in_addr address{};
    if (inet_pton(AF_INET, options.interface.c_str(), &address) != 1)
      throw std::invalid_argument("--interface: neither 'local', 'all' nor an IPv4 address: " + options.interface);
    udp->interfaceWhiteList.push_back(options.interface);
  }
  qos.transport().user_transports.push_back(udp);
}

void set_discovery(const NetworkOptions& options, fdds::DomainParticipantQos& qos) {
  auto& config = qos.wire_protocol().builtin.discovery_config;
  config.leaseDuration = duration(options.lease);
  config.leaseDuration_announcementperiod = duration(std::min(kAnnouncePeriod, options.lease / 4));
  if (options.discovery_server.empty()) return;
  const std::size_t colon = options.discovery_server.rfind(':');
  int port = 0;
  if (colon != std::string::npos) port = std::atoi(options.discovery_server.c_str() + colon + 1);
  const std::string host = options.discovery_server.substr(0, colon);
  if (port <= 0 || port > 65535)
    throw std::invalid_argument("--discovery-server: not HOST:PORT: " + options.discovery_server);
  const auto [v4, v6] = frtps::IPLocator::resolveNameDNS(host);
  in_addr literal{};
  const bool is_address = inet_pton(AF_INET, host.c_str(), &literal) == 1;
  if (!is_address && v4.empty()) throw std::invalid_argument("--discovery-server: unknown host: " + host);
  frtps::Locator_t locator(LOCATOR_KIND_UDPv4, static_cast<std::uint32_t>(port));
  frtps::IPLocator::setIPv4(locator, is_address ? host : *v4.begin());
  eprosima::fastdds::rtps::RemoteServerAttributes server;
  server.ReadguidPrefix("44.53.00.5f.45.50.52.4f.53.49.4d.41");  // of `fast-discovery-server -i 0`
  server.metatrafficUnicastLocatorList.push_back(locator);
  config.discoveryProtocol = frtps::DiscoveryProtocol_t::CLIENT;
  config.m_DiscoveryServers.push_back(server);
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

struct Participant::Impl {
  fdds::DomainParticipant* participant = nullptr;
  fdds::Publisher* publisher = nullptr;
  fdds::Subscriber* subscriber = nullptr;
  std::mutex mutex;  // guards the creation of topics, which a writer and a reader may share

  ~Impl() {
    if (participant == nullptr) return;
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
};

Participant::Participant(const NetworkOptions& options, const std::string& session, const std::string& name)
    : impl_(std::make_unique<Impl>()) {
  route_log_once();
  fdds::DomainParticipantQos qos;
  qos.name(name);
  set_transports(options, qos);
  set_discovery(options, qos);
  impl_->participant = fdds::DomainParticipantFactory::get_instance()->create_participant(options.domain, qos);
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
}

Participant::~Participant() = default;

// ---- writers
// ----------------------------------------------------------------------------------------------------------

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
// ----------------------------------------------------------------------------------------------------------

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
SODA_WIRE_NAME(Border)
SODA_WIRE_NAME(Status)
SODA_WIRE_NAME(Digests)
SODA_WIRE_NAME(StateChunk)
SODA_WIRE_NAME(Transforms)
#undef SODA_WIRE_NAME

}  // namespace soda::dds
