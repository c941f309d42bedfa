// Private: HDF5's types, for the .cc files of this folder.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "dataset/arrays/hdf5_handle.h"

namespace mvstudio::dataset::internal {

/// Reads HDF5 files of other programs: only the objects that are asked for, by hard links alone. External and virtual
/// datasets and soft links are refused; sizes are checked against the file's before anything is read. Numbers of any size
/// and byte order become doubles. Errors are FormatErrors with the object, IoError for a file that cannot be opened.
class ForeignHdf5 {
 public:
  explicit ForeignHdf5(const std::string& path);

  const std::string& path() const { return path_; }
  /// True when every part of the path is a hard link.
  bool Has(const std::string& object) const;
  /// Names in a group, at most 1000, sorted.
  std::vector<std::string> Members(const std::string& group) const;
  bool HasAttribute(const std::string& object, const std::string& name) const;
  /// One text of fixed or variable length; an empty one for an attribute without a value.
  std::string TextAttribute(const std::string& object, const std::string& name) const;

  std::vector<uint64_t> Dims(const std::string& dataset) const;
  /// A whole dataset of numbers, row-major.
  std::vector<double> Numbers(const std::string& dataset) const;
  /// A list of texts.
  std::vector<std::string> Texts(const std::string& dataset) const;
  /// Names of the members of a compound type; empty when the dataset holds something else.
  std::vector<std::string> Fields(const std::string& dataset) const;
  /// One member of every row: rows x per_row numbers.
  std::vector<double> Field(const std::string& dataset, const std::string& field, size_t* per_row) const;

  [[noreturn]] void Fail(const std::string& object, const std::string& what) const;

 private:
  Hid Open(const std::string& dataset) const;
  /// Number of elements; throws when `count * bytes` does not fit the file.
  uint64_t Elements(const std::string& name, hid_t dataset, uint64_t bytes) const;
  void CheckStorage(const std::string& name, hid_t dataset) const;
  void ReadTo(const std::string& name, hid_t dataset, hid_t type, void* data) const;

  std::string path_;
  uint64_t file_bytes_ = 0;
  std::unique_lock<std::recursive_mutex> lock_;
  Hid file_;
};

}  // namespace mvstudio::dataset::internal
