// A process's membership in a session, and its typed writers and readers. RAII over Fast DDS; no Fast DDS type leaks
// out but through types.h.
//
// Handlers run on threads of DDS, possibly before the constructor of the object that they serve has ended, one at a
// time for each reader, and must be quick: a slow handler delays the other topics of its participant. After a Writer or
// Reader is destroyed none of its handlers runs.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "common/dds/network_options.h"
#include "common/dds/refusals.h"
#include "common/dds/topics.h"
#include "common/dds/types.h"

namespace eprosima::fastdds::dds {
class DataReader;
class DataWriter;
}  // namespace eprosima::fastdds::dds

namespace soda::dds {

class Participant {
 public:
  // Throws std::invalid_argument for options that make no sense, std::runtime_error when the network cannot be used so.
  // `name` is for tools and logs.
  Participant(const NetworkOptions& options, const std::string& session, const std::string& name);
  ~Participant();
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;

  struct Impl;
  Impl& impl() { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

using WriterKey = std::array<unsigned char, 16>;  // names a writer in the whole session

// The untyped halves; use Writer and Reader.
class WriterBase {
 public:
  using MatchHandler = std::function<void(int change)>;  // readers found (+) or lost (-)
  WriterBase(Participant& participant, const Topic& topic, eprosima::fastdds::dds::TopicDataType* type,
             MatchHandler on_match);
  ~WriterBase();
  WriterBase(const WriterBase&) = delete;
  WriterBase& operator=(const WriterBase&) = delete;

  WriterKey key() const;
  bool matched() const;  // is there a reader?
  // Whether all that was written has been acknowledged by all readers there are, waiting for it as long as that.
  bool wait_acknowledged(std::chrono::milliseconds at_most);

 protected:
  bool write_raw(const void* sample);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <class T>
class Writer : public WriterBase {
 public:
  Writer(Participant& participant, const Topic& topic, MatchHandler on_match = nullptr);
  // False: not written, because the history was full for as long as the topic's flow allows. Nothing was sent.
  bool write(const T& sample) { return write_raw(&sample); }
};

class ReaderBase {
 public:
  using MatchHandler = std::function<void(int change)>;  // writers found (+) or lost (-)
  ReaderBase(Participant& participant, const Topic& topic, eprosima::fastdds::dds::TopicDataType* type,
             std::function<void(eprosima::fastdds::dds::DataReader&)> on_data, MatchHandler on_match);
  ~ReaderBase();
  ReaderBase(const ReaderBase&) = delete;
  ReaderBase& operator=(const ReaderBase&) = delete;

 protected:
  // Takes the next sample into a Received<T>. False: there is none.
  static bool take_raw(eprosima::fastdds::dds::DataReader& reader, void* received, WriterKey& writer, bool& valid);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Hands every sample that passed the door to `handler`; what did not is counted and logged.
template <class T>
class Reader : public ReaderBase {
 public:
  using Handler = std::function<void(T&& sample, const WriterKey& writer)>;
  Reader(Participant& participant, const Topic& topic, Handler handler, MatchHandler on_match = nullptr);

 private:
  static void take_all(eprosima::fastdds::dds::DataReader& reader, const std::string& name, const Handler& handler);
};

template <class T>
const char* wire_name();  // "soda::wire::T"

template <class T>
Writer<T>::Writer(Participant& participant, const Topic& topic, MatchHandler on_match)
    : WriterBase(participant, topic, new WireType<T>(wire_name<T>()), std::move(on_match)) {}

template <class T>
Reader<T>::Reader(Participant& participant, const Topic& topic, Handler handler, MatchHandler on_match)
    : ReaderBase(
          participant, topic, new WireType<T>(wire_name<T>()),
          [name = topic.name, handler = std::move(handler)](auto& reader) { take_all(reader, name, handler); },
          std::move(on_match)) {}

template <class T>
void Reader<T>::take_all(eprosima::fastdds::dds::DataReader& reader, const std::string& name, const Handler& handler) {
  Received<T> received;
  WriterKey writer{};
  for (bool valid = false; take_raw(reader, &received, writer, valid);) {
    if (!valid) continue;  // news of an instance, without data
    if (received.refusal.empty())
      handler(std::move(received.sample), writer);
    else
      refusals().add(name, received.refusal);
    received = {};
  }
}

}  // namespace soda::dds
