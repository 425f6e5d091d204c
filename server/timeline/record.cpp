#include "server/timeline/record.h"

#include <array>
#include <cstring>
#include <new>

#include "common/recycled.h"
#include "common/state_hash.h"

namespace soda::timeline {
namespace {

// By number of contact records.
class Pool {
 public:
  void* take(std::uint32_t contacts) {
    const std::size_t bytes = sizeof(Record) + contacts * sizeof(ContactRecord);
    return contacts < kSizes ? free_[contacts].take(bytes) : ::operator new(bytes);
  }
  void give_back(void* block, std::uint32_t contacts) {
    if (contacts < kSizes)
      free_[contacts].give_back(block);
    else
      ::operator delete(block);
  }

 private:
  static constexpr std::uint32_t kSizes = 32;
  std::array<FreeBlocks, kSizes> free_;
};

thread_local Pool pool;

}  // namespace

void release(Record* record) { pool.give_back(record, record->count); }

Ref<Record> make_record(const BodyState& body, std::span<const ContactRecord> contacts, const Place& place,
                        Step computed) {
  const auto count = static_cast<std::uint32_t>(contacts.size());
  auto* record = new (pool.take(count)) Record{body, place, body_hash(body), computed, 0, count};
  if (count > 0) std::memcpy(static_cast<void*>(record + 1), contacts.data(), contacts.size_bytes());
  return Ref(record);
}

bool same(const Record& record, const BodyState& body, std::span<const ContactRecord> contacts) {
  return std::memcmp(&record.body, &body, sizeof body) == 0 && record.count == contacts.size() &&
         (contacts.empty() || std::memcmp(record.contacts().data(), contacts.data(), contacts.size_bytes()) == 0);
}

}  // namespace soda::timeline
