// Private: HDF5's types, for the .cc files of this folder and of exports/.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "dataset/arrays/hdf5_handle.h"

/// Files are written in memory with the library's newest format (its metadata carry checksums) and handed out as bytes, so that
/// every write to the disk goes through core/disk/files.h. No time stamps: the same calls give the same bytes. Every dataset is
/// chunked with fletcher32.
namespace mvstudio::dataset::internal {

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

}  // namespace mvstudio::dataset::internal
