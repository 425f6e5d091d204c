// A counted reference to an object that counts for itself. Not atomic: what a timeline shares stays on its thread.
#pragma once

#include <cstdint>
#include <utility>

namespace soda {

// T has a member `std::uint32_t references`, 0 when new, and a function release(T*) that is found for it.
template <class T>
class Ref {
 public:
  Ref() = default;
  explicit Ref(T* object) : object_(object) { hold(); }
  Ref(const Ref& other) : object_(other.object_) { hold(); }
  Ref(Ref&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Ref& operator=(Ref other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~Ref() {
    if (object_ && --object_->references == 0) release(object_);
  }
  T* get() const { return object_; }
  T& operator*() const { return *object_; }
  T* operator->() const { return object_; }
  explicit operator bool() const { return object_ != nullptr; }
  bool shared() const { return object_ && object_->references > 1; }
  bool operator==(const Ref&) const = default;

 private:
  void hold() {
    if (object_) ++object_->references;
  }
  T* object_ = nullptr;
};

}  // namespace soda
