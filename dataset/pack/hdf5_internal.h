#pragma once

#include <hdf5.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

/// Typed, checked access to HDF5; included by .cc files of this module and of exports/ only.
///
/// Files are written in memory with the library's newest format (its metadata carry checksums) and handed out as bytes, so that
/// every write to the disk goes through core/disk/files.h. No time stamps: the same calls give the same bytes. Every dataset is
/// chunked with fletcher32.
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

struct ArrayLayout {
  std::vector<uint64_t> chunk;  ///< empty: rows of the first dimension, up to about 1 MiB per chunk
  int deflate = 0;              ///< 1 … 9, with byte shuffling; 0: not compressed
};

/// The bytes of a finished file.
struct FileImage {
  std::unique_ptr<void, decltype(&std::free)> data{nullptr, &std::free};
  size_t size = 0;
  std::string_view view() const { return {static_cast<const char*>(data.get()), size}; }
};

/// A new file in memory. Paths are "/group/name"; intermediate groups are created. Throws IoError (messages name `label`).
class Hdf5Writer {
 public:
  explicit Hdf5Writer(std::string label);
  ~Hdf5Writer();
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  void Group(const std::string& path);
  /// Row-major.
  template <class T>
  void Array(const std::string& path, const std::vector<uint64_t>& dims, const T* data, const ArrayLayout& layout = {}) {
    Array(path, dims, data, FileType<T>(), MemoryType<T>(), sizeof(T), layout);
  }
  template <class T>
  void Array(const std::string& path, const std::vector<T>& data, const ArrayLayout& layout = {}) {
    Array(path, {data.size()}, data.data(), layout);
  }
  /// Attributes of an existing group or dataset; "/" is the root. Text is UTF-8 of fixed length.
  void Attribute(const std::string& object, const std::string& name, const std::string& text);
  void Attribute(const std::string& object, const std::string& name, const char* text) {
    Attribute(object, name, std::string(text));
  }
  template <class T>
  void Attribute(const std::string& object, const std::string& name, const T& value) {
    Attribute(object, name, FileType<T>(), MemoryType<T>(), &value);
  }
  /// Closes the file; nothing may be added afterwards.
  FileImage Finish();

 private:
  void Array(const std::string& path, const std::vector<uint64_t>& dims, const void* data, hid_t file_type, hid_t memory_type,
             size_t item_bytes, const ArrayLayout& layout);
  void Attribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type, const void* value);
  [[noreturn]] void Fail(const std::string& path, const std::string& action) const;

  std::unique_lock<std::recursive_mutex> lock_;
  std::string label_;
  FileImage image_;
  Hid file_;
};

/// Limits on a file, checked before its data are read.
struct Hdf5Limits {
  uint64_t max_objects = 1000;  ///< groups and datasets
  int max_depth = 8;
  int max_attributes = 64;          ///< of one object
  uint64_t max_bytes = 1ull << 36;  ///< of all datasets together, unpacked
  uint64_t max_chunk_bytes = 1 << 28;
  double max_ratio = 200;  ///< unpacked bytes to bytes of the file; deflate cannot do better than about 1000
};

/// Reads a file after checking its whole structure. Allowed are hard links only (no soft, external or user-defined links),
/// and no virtual or external datasets. No named types; only numbers or fixed text of standard size. The only filters are
/// shuffle, deflate and fletcher32. Dimensions must multiply without overflow and fit the file. Throws IoError, or
/// FormatError with the object.
///
/// The library itself can crash or loop on a damaged file: for files from others use RunInChild (isolate_internal.h)
/// first.
class Hdf5Reader {
 public:
  explicit Hdf5Reader(const std::string& path, const Hdf5Limits& limits = {});

  bool Has(const std::string& object) const;
  bool HasAttribute(const std::string& object, const std::string& name) const;
  std::vector<uint64_t> Dims(const std::string& dataset) const;
  /// Whole dataset of exactly this type and, when `dims` is not empty, exactly these dimensions.
  template <class T>
  std::vector<T> Array(const std::string& dataset, const std::vector<uint64_t>& dims = {}) const {
    std::vector<T> data(CheckArray(dataset, FileType<T>(), dims));
    ReadAll(dataset, MemoryType<T>(), data.data());
    return data;
  }
  std::string TextAttribute(const std::string& object, const std::string& name) const;
  template <class T>
  T Attribute(const std::string& object, const std::string& name) const {
    T value{};
    ReadAttribute(object, name, FileType<T>(), MemoryType<T>(), &value);
    return value;
  }

  /// Where the pieces of a one-dimensional, uncompressed byte dataset lie in the file.
  struct Chunk {
    uint64_t file_offset = 0;
    uint64_t stored_bytes = 0;
  };
  struct Chunks {
    uint64_t chunk_bytes = 0;
    std::vector<Chunk> chunks;  // in order
  };
  Chunks ByteChunks(const std::string& dataset) const;

  const std::string& path() const { return path_; }
  uint64_t file_bytes() const { return file_bytes_; }

 private:
  size_t CheckArray(const std::string& dataset, hid_t type, const std::vector<uint64_t>& dims) const;
  void ReadAll(const std::string& dataset, hid_t memory_type, void* data) const;
  void ReadAttribute(const std::string& object, const std::string& name, hid_t file_type, hid_t memory_type, void* value) const;
  Hid OpenDataset(const std::string& dataset) const;
  [[noreturn]] void Fail(const std::string& object, const std::string& what) const;

  std::string path_;
  uint64_t file_bytes_ = 0;
  std::unique_lock<std::recursive_mutex> lock_;
  Hid file_;
};

/// The structure rules above. Throws FormatError.
void CheckHdf5Structure(hid_t file, const std::string& path, uint64_t file_bytes, const Hdf5Limits& limits);

}  // namespace mvstudio::dataset::internal
