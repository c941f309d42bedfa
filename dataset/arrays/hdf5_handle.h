// Private: HDF5's types, for the .cc files of this folder, of exports/ and of dataset/trackers/.
#pragma once

#include <hdf5.h>

#include <mutex>
#include <string>
#include <utility>

/// The lock, the ids and the types of numbers that readers and writers of HDF5 share.
namespace mvstudio::dataset::internal {

/// HDF5 has global state: every caller holds this lock. Taking it silences the library's own printing.
std::unique_lock<std::recursive_mutex> LockHdf5();
/// In a child that was forked while its parent held the lock: its copy has no owner, so a new lock replaces it.
void RenewHdf5LockInChild();

/// Owns one HDF5 id.
class Hid {
 public:
  using Closer = herr_t (*)(hid_t);
  Hid() = default;
  Hid(hid_t id, Closer closer) : id_(id), closer_(closer) {}
  Hid(Hid&& other) noexcept : id_(other.id_), closer_(other.closer_) { other.id_ = -1; }
  Hid& operator=(Hid&& other) noexcept {
    std::swap(id_, other.id_), std::swap(closer_, other.closer_);
    return *this;
  }
  ~Hid() { Close(); }
  herr_t Close() {
    const hid_t id = id_;
    id_ = -1;
    return id >= 0 ? closer_(id) : 0;
  }
  bool ok() const { return id_ >= 0; }
  operator hid_t() const { return id_; }

 private:
  hid_t id_ = -1;
  Closer closer_ = nullptr;
};

/// The library's innermost message for the last error.
std::string LastHdf5Error();

/// File type of T: little-endian, IEEE or two's complement.
template <class T>
hid_t FileType();
template <class T>
hid_t MemoryType();

}  // namespace mvstudio::dataset::internal
