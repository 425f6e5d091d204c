// Memory of objects that come and go by the thousand in each step: what is given back is kept for the next of its kind.
#pragma once

#include <cstddef>
#include <deque>
#include <iterator>
#include <new>

#include "common/prefetch.h"

namespace soda {

#ifdef __SANITIZE_ADDRESS__
constexpr bool kRecycling = false;  // so that it sees what is used too late
#else
constexpr bool kRecycling = true;
#endif

// A stack of blocks of one size. Each block is memory of its own, so it may end up with another thread.
class FreeBlocks {
 public:
  FreeBlocks() = default;
  FreeBlocks(const FreeBlocks&) = delete;
  FreeBlocks& operator=(const FreeBlocks&) = delete;
  ~FreeBlocks() {
    for (void* const block : blocks_) ::operator delete(block);
  }
  // What was given back long ago is in no cache; nor are those that will be taken next.
  void* take(std::size_t bytes) {
    if (blocks_.empty()) return ::operator new(bytes);
    void* const block = blocks_.back();
    blocks_.pop_back();
    if (std::ssize(blocks_) >= kAhead) prefetch(blocks_.end()[-kAhead], bytes);
    return block;
  }
  void give_back(void* block) {
    if (kRecycling)
      blocks_.push_back(block);
    else
      ::operator delete(block);
  }

 private:
  static constexpr std::ptrdiff_t kAhead = 2;
  std::deque<void*> blocks_;  // does not move what it holds when it grows
};

// A base for classes whose objects are made by `new` and dropped by `delete` all the time.
template <class T>
class Recycled {
 public:
  static void* operator new(std::size_t bytes) { return blocks().take(bytes); }
  static void operator delete(void* block) { blocks().give_back(block); }

 private:
  static FreeBlocks& blocks() {
    static_assert(alignof(T) <= __STDCPP_DEFAULT_NEW_ALIGNMENT__);
    thread_local FreeBlocks free;
    return free;
  }
};

}  // namespace soda
