// A persistent array of references: copying it costs next to nothing, and what two copies have in common they share.
// Two levels of pages, copied on write.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "common/prefetch.h"
#include "common/recycled.h"
#include "common/ref.h"

namespace soda {

template <class T>
class Table {
 public:
  using Slot = std::uint32_t;
  using Item = std::pair<Slot, Ref<T>>;

  explicit Table(std::size_t slots = 0) : groups_((slots + kGroupSlots - 1) / kGroupSlots) {}

  T* get(Slot slot) const {
    if (slot / kGroupSlots >= groups_.size()) return nullptr;
    const Group* group = groups_[slot / kGroupSlots].get();
    if (!group) return nullptr;
    const Page* page = group->pages[slot / kPageSlots % kGroupPages].get();
    return page ? page->slots[slot % kPageSlots].get() : nullptr;
  }

  // Whether nothing has been set in either since one was a copy of the other. If not, they may still be equal.
  bool same_as(const Table& other) const { return groups_ == other.groups_; }

  void set(Slot slot, Ref<T> object) {
    Item item{slot, std::move(object)};
    assign(std::span(&item, 1));
  }

  // Sets all `items`, each slot once, and takes their references; leaves them ascending by slot. Cheaper than one by
  // one: what is replaced in a shared page is not even looked at.
  void assign(std::span<Item> items) {
    const auto before = [](const Item& l, const Item& r) { return l.first < r.first; };
    if (!std::is_sorted(items.begin(), items.end(), before)) std::sort(items.begin(), items.end(), before);
    for (std::size_t first = 0, end = 0; first < items.size(); first = end) {
      const auto page_number = static_cast<Slot>(items[first].first / kPageSlots);
      while (end < items.size() && static_cast<Slot>(items[end].first / kPageSlots) == page_number) ++end;
      Ref<Page>& page = own_page(page_number);
      if (!page || page.shared()) {
        Ref<Page> fresh(new Page);
        if (page) {
          std::size_t next = first;
          for (Slot s = 0; s < kPageSlots; ++s) {
            if (next < end && items[next].first % kPageSlots == s)
              ++next;
            else
              fresh->slots[s] = page->slots[s];
          }
        }
        page = std::move(fresh);
      }
      for (std::size_t i = first; i < end; ++i) page->slots[items[i].first % kPageSlots] = std::move(items[i].second);
    }
  }

  // f(slot, const T* before, const T* now) for each slot in which `now` refers to another object than `before`,
  // ascending; null where there is none. What they share costs nothing.
  template <typename F>
  static void for_each_difference(const Table& before, const Table& now, F&& f) {
    for (std::size_t g = 0; g < std::max(before.groups_.size(), now.groups_.size()); ++g) {
      const Group* const from = g < before.groups_.size() ? before.groups_[g].get() : nullptr;
      const Group* const to = g < now.groups_.size() ? now.groups_[g].get() : nullptr;
      if (from == to) continue;
      for (std::size_t p = 0; p < kGroupPages; ++p) {
        const Page* const old_page = from ? from->pages[p].get() : nullptr;
        const Page* const new_page = to ? to->pages[p].get() : nullptr;
        if (old_page == new_page) continue;
        for (std::size_t s = 0; s < kPageSlots; ++s) {
          const T* const l = old_page ? old_page->slots[s].get() : nullptr;
          const T* const r = new_page ? new_page->slots[s].get() : nullptr;
          if (l != r) f(static_cast<Slot>((g * kGroupPages + p) * kPageSlots + s), l, r);
        }
      }
    }
  }

  // f(slot, const Ref<T>&) for everything there is, ascending.
  template <typename F>
  void for_each(F&& f) const {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (!groups_[g]) continue;
      for (std::size_t p = 0; p < kGroupPages; ++p) {
        const Page* page = groups_[g]->pages[p].get();
        if (!page) continue;
        for (std::size_t s = 0; s < kPageSlots; ++s)
          if (page->slots[s]) f(static_cast<Slot>((g * kGroupPages + p) * kPageSlots + s), page->slots[s]);
      }
    }
  }

 private:
  static constexpr std::size_t kPageSlots = 32, kGroupPages = 32, kGroupSlots = kPageSlots * kGroupPages;
  struct Page : Recycled<Page> {
    std::uint32_t references = 0;
    std::array<Ref<T>, kPageSlots> slots;
    // What falls out of the window has long left the caches: all of it is asked for at once.
    friend void release(Page* page) {
      for (const Ref<T>& slot : page->slots)
        if (slot) prefetch(&slot->references, sizeof slot->references);
      delete page;
    }
  };
  struct Group : Recycled<Group> {
    std::uint32_t references = 0;
    std::array<Ref<Page>, kGroupPages> pages;
    friend void release(Group* group) {
      for (const Ref<Page>& page : group->pages)
        if (page) prefetch(page.get(), sizeof(Page));
      delete group;
    }
  };

  Ref<Page>& own_page(Slot page_number) {
    const std::size_t g = page_number / kGroupPages;
    if (g >= groups_.size()) groups_.resize(g + 1);
    Ref<Group>& group = groups_[g];
    if (!group) {
      group = Ref<Group>(new Group);
    } else if (group.shared()) {
      Ref<Group> copy(new Group);
      copy->pages = group->pages;
      group = std::move(copy);
    }
    return group->pages[page_number % kGroupPages];
  }

  std::vector<Ref<Group>> groups_;
};

}  // namespace soda
