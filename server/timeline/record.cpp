#include "server/timeline/record.h"

#include <array>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <new>
#include <vector>

#include "common/prefetch.h"
#include "common/state_hash.h"

namespace soda::timeline {
namespace {

// Blocks by number of contact records. Each block is memory of its own, so it may end up with another thread.
class Pool {
 public:
  ~Pool() {
    for (auto& blocks : free_)
      for (void* block : blocks) std::free(block);
  }
  // The block was given back when it fell out of the window, so no cache holds it; nor those that will be taken next.
  void* take(std::uint32_t contacts) {
    const std::size_t bytes = sizeof(Record) + contacts * sizeof(ContactRecord);
    if (contacts < kSizes && !free_[contacts].empty()) {
      std::vector<void*>& blocks = free_[contacts];
      void* block = blocks.back();
      blocks.pop_back();
      if (std::ssize(blocks) >= kAhead) prefetch(blocks.end()[-kAhead], bytes);
      return block;
    }
    void* block = std::malloc(bytes);
    if (!block) throw std::bad_alloc();
    return block;
  }
  void give_back(void* block, std::uint32_t contacts) {
    if (kPooled && contacts < kSizes)
      free_[contacts].push_back(block);
    else
      std::free(block);
  }

 private:
  static constexpr std::uint32_t kSizes = 32;
  static constexpr std::ptrdiff_t kAhead = 2;
#ifdef __SANITIZE_ADDRESS__
  static constexpr bool kPooled = false;  // so that it sees what is used too late
#else
  static constexpr bool kPooled = true;
#endif
  std::array<std::vector<void*>, kSizes> free_;
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
