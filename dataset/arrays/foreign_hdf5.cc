#include "dataset/arrays/foreign_hdf5.h"

#include <algorithm>
#include <filesystem>
#include <limits>

#include "core/disk/lock.h"
#include "core/disk/npy.h"
#include "core/error.h"

namespace mvstudio::dataset::internal {
namespace {

constexpr uint64_t kMaxBytes = 1ull << 31;  // of one dataset, unpacked
constexpr uint64_t kMaxRatio = 1100;        // deflate cannot do better
constexpr size_t kMaxTextBytes = 1 << 24;

bool IsNumber(hid_t type) {
  const H5T_class_t kind = H5Tget_class(type);
  return kind == H5T_INTEGER || kind == H5T_FLOAT || kind == H5T_ENUM;
}

/// Up to the first zero byte, without blanks at the end.
std::string Trimmed(const char* text, size_t bytes) {
  std::string value(text, std::find(text, text + bytes, '\0'));
  while (!value.empty() && value.back() == ' ') value.pop_back();
  return value;
}

}  // namespace

ForeignHdf5::ForeignHdf5(const std::string& path) : path_(path), lock_(LockHdf5()) {
  RequireNoWriter(path);
  std::error_code code;
  file_bytes_ = std::filesystem::file_size(path, code);
  if (code) throw IoError(path, "cannot read: " + code.message());
  const Hid access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_file_locking(access, false, true);
  file_ = Hid(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose);
  if (!file_.ok()) {
    Fail("", "is no readable HDF5 file, or is cut off or damaged (" + LastHdf5Error() +
                 "); copy it again from where it was written, or export it again");
  }
}

void ForeignHdf5::Fail(const std::string& object, const std::string& what) const { throw FormatError(path_, object, what); }

bool ForeignHdf5::Has(const std::string& object) const {
  for (size_t end = object.find('/', 1);; end = object.find('/', end + 1)) {
    const std::string part = object.substr(0, end);
    if (part.size() > 1) {
      H5L_info_t link{};
      if (H5Lexists(file_, part.c_str(), H5P_DEFAULT) <= 0) return false;
      if (H5Lget_info(file_, part.c_str(), &link, H5P_DEFAULT) < 0 || link.type != H5L_TYPE_HARD) return false;
    }
    if (end == std::string::npos) return true;
  }
}

std::vector<std::string> ForeignHdf5::Members(const std::string& group) const {
  constexpr hsize_t kMaxMembers = 1000;
  const Hid id(H5Gopen2(file_, group.c_str(), H5P_DEFAULT), H5Gclose);
  H5G_info_t info{};
  if (!id.ok() || H5Gget_info(id, &info) < 0) Fail(group, "cannot be read as a group: " + LastHdf5Error());
  std::vector<std::string> names;
  for (hsize_t i = 0; i < std::min(info.nlinks, kMaxMembers); ++i) {
    char text[256];
    const ssize_t length = H5Lget_name_by_idx(id, ".", H5_INDEX_NAME, H5_ITER_INC, i, text, sizeof(text), H5P_DEFAULT);
    if (length > 0 && length < static_cast<ssize_t>(sizeof(text))) names.emplace_back(text);
  }
  return names;
}

bool ForeignHdf5::HasAttribute(const std::string& object, const std::string& name) const {
  return Has(object) && H5Aexists_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

std::string ForeignHdf5::TextAttribute(const std::string& object, const std::string& name) const {
  const std::string place = object + "@" + name;
  const Hid attribute(
      HasAttribute(object, name) ? H5Aopen_by_name(file_, object.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT) : -1,
      H5Aclose);
  if (!attribute.ok()) Fail(place, "is missing");
  const Hid type(H5Aget_type(attribute), H5Tclose), space(H5Aget_space(attribute), H5Sclose);
  if (H5Tget_class(type) != H5T_STRING) Fail(place, "is no text");
  if (H5Sget_simple_extent_npoints(space) < 1) return "";
  if (H5Sget_simple_extent_npoints(space) != 1) Fail(place, "is a list, one text was expected");
  if (H5Tis_variable_str(type) > 0) {
    char* text = nullptr;
    if (H5Aread(attribute, type, &text) < 0) Fail(place, "is damaged: " + LastHdf5Error());
    const std::string value = text ? text : "";
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, &text);
    return value;
  }
  const size_t bytes = H5Tget_size(type);
  if (bytes > kMaxTextBytes) Fail(place, "is a text of " + std::to_string(bytes) + " bytes; refused");
  std::string value(bytes, '\0');
  if (H5Aread(attribute, type, value.data()) < 0) Fail(place, "is damaged: " + LastHdf5Error());
  return value.substr(0, value.find('\0'));
}

void ForeignHdf5::CheckStorage(const std::string& name, hid_t dataset) const {
  const Hid properties(H5Dget_create_plist(dataset), H5Pclose);
  if (H5Pget_layout(properties) == H5D_VIRTUAL || H5Pget_external_count(properties) != 0) {
    Fail(name, "keeps its numbers in another file; refused");
  }
  for (int i = 0; i < H5Pget_nfilters(properties); ++i) {
    unsigned flags = 0, config = 0;
    size_t num_values = 0;
    char text[64] = "";
    const H5Z_filter_t filter =
        H5Pget_filter2(properties, static_cast<unsigned>(i), &flags, &num_values, nullptr, sizeof(text), text, &config);
    if (filter == H5Z_FILTER_SHUFFLE || filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_FLETCHER32) continue;
    Fail(name, std::string("is packed with the filter ") + (*text ? text : std::to_string(filter).c_str()) +
                   ", which is not read; write the file with gzip or without compression, or export a CSV file");
  }
}

Hid ForeignHdf5::Open(const std::string& dataset) const {
  if (!Has(dataset)) Fail(dataset, "is missing, or a link");
  Hid id(H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!id.ok()) Fail(dataset, "cannot be opened as a dataset: " + LastHdf5Error());
  CheckStorage(dataset, id);
  return id;
}

std::vector<uint64_t> ForeignHdf5::Dims(const std::string& dataset) const {
  constexpr int kMaxRank = 8;
  const Hid id = Open(dataset), space(H5Dget_space(id), H5Sclose);
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank < 0 || rank > kMaxRank) Fail(dataset, "has " + std::to_string(rank) + " dimensions");
  std::vector<hsize_t> dims(static_cast<size_t>(rank));
  if (rank > 0) H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  return {dims.begin(), dims.end()};
}

uint64_t ForeignHdf5::Elements(const std::string& name, hid_t dataset, uint64_t bytes) const {
  const Hid type(H5Dget_type(dataset), H5Tclose);
  const uint64_t stored = std::max<uint64_t>(H5Tget_size(type), 1);
  uint64_t count = 1;
  for (const uint64_t d : Dims(name)) {
    if (d > 0 && count > kMaxBytes / d) Fail(name, "claims more than 2 GiB; refused");
    count *= d;
  }
  if (count > kMaxBytes / std::max(bytes, stored) || count * stored / kMaxRatio > file_bytes_) {
    Fail(name, "claims " + std::to_string(count) + " entries in a file of " + std::to_string(file_bytes_) + " bytes; refused");
  }
  if (OutOfProportion(count * std::max(bytes, stored), file_bytes_)) {
    Fail(name, "unpacks to " + std::to_string(count * std::max(bytes, stored)) +
                   " bytes, out of all proportion to the file's " + std::to_string(file_bytes_) +
                   ": almost all of it is empty; export fewer tracks or frames");
  }
  return count;
}

void ForeignHdf5::ReadTo(const std::string& name, hid_t dataset, hid_t type, void* data) const {
  if (H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data) >= 0) return;
  Fail(name, "is damaged: " + LastHdf5Error() + "; export the file again");
}

std::vector<double> ForeignHdf5::Numbers(const std::string& dataset) const {
  const Hid id = Open(dataset), type(H5Dget_type(id), H5Tclose);
  if (!IsNumber(type)) Fail(dataset, "holds no numbers");
  const uint64_t count = Elements(dataset, id, sizeof(double));
  if (count == 0) return {};
  if (H5Tget_class(type) == H5T_ENUM) {
    std::vector<int8_t> flags(count);
    if (H5Tget_size(type) != 1) Fail(dataset, "holds no numbers");
    ReadTo(dataset, id, type, flags.data());
    return {flags.begin(), flags.end()};
  }
  std::vector<double> numbers(count);
  ReadTo(dataset, id, H5T_NATIVE_DOUBLE, numbers.data());
  return numbers;
}

std::vector<std::string> ForeignHdf5::Texts(const std::string& dataset) const {
  constexpr uint64_t kMaxTexts = 1'000'000;
  const Hid id = Open(dataset), type(H5Dget_type(id), H5Tclose), space(H5Dget_space(id), H5Sclose);
  const uint64_t count = Elements(dataset, id, sizeof(char*));
  if (count == 0) return {};  // h5py stores an empty list as numbers
  if (H5Tget_class(type) != H5T_STRING) Fail(dataset, "holds no names");
  if (count > kMaxTexts) Fail(dataset, "holds " + std::to_string(count) + " names; refused");
  std::vector<std::string> texts;
  if (H5Tis_variable_str(type) > 0) {
    std::vector<char*> pointers(count, nullptr);
    ReadTo(dataset, id, type, pointers.data());
    for (const char* text : pointers) texts.emplace_back(text ? text : "");
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, pointers.data());
    return texts;
  }
  const size_t bytes = H5Tget_size(type);
  std::string data(count * bytes, '\0');
  ReadTo(dataset, id, type, data.data());
  for (uint64_t i = 0; i < count; ++i) texts.push_back(Trimmed(data.data() + i * bytes, bytes));
  return texts;
}

std::vector<std::string> ForeignHdf5::Fields(const std::string& dataset) const {
  const Hid id = Open(dataset), type(H5Dget_type(id), H5Tclose);
  std::vector<std::string> names;
  if (H5Tget_class(type) != H5T_COMPOUND) return names;
  for (int i = 0; i < H5Tget_nmembers(type); ++i) {
    char* text = H5Tget_member_name(type, static_cast<unsigned>(i));
    names.emplace_back(text ? text : "");
    H5free_memory(text);
  }
  return names;
}

std::vector<double> ForeignHdf5::Field(const std::string& dataset, const std::string& field, size_t* per_row) const {
  const std::string place = dataset + "." + field;
  const Hid id = Open(dataset), type(H5Dget_type(id), H5Tclose);
  const int index = H5Tget_class(type) == H5T_COMPOUND ? H5Tget_member_index(type, field.c_str()) : -1;
  if (index < 0) Fail(place, "is missing");
  const Hid member(H5Tget_member_type(type, static_cast<unsigned>(index)), H5Tclose);
  const bool is_array = H5Tget_class(member) == H5T_ARRAY;
  const Hid base(is_array ? H5Tget_super(member) : H5Tcopy(member), H5Tclose);
  if (!IsNumber(base) || H5Tget_size(base) == 0) Fail(place, "holds no numbers");
  const hsize_t width = H5Tget_size(member) / H5Tget_size(base);
  const uint64_t count = Elements(dataset, id, width * sizeof(double));
  const Hid row(is_array ? H5Tarray_create2(H5T_NATIVE_DOUBLE, 1, &width) : H5Tcopy(H5T_NATIVE_DOUBLE), H5Tclose);
  const Hid memory(H5Tcreate(H5T_COMPOUND, width * sizeof(double)), H5Tclose);
  if (!memory.ok() || H5Tinsert(memory, field.c_str(), 0, row) < 0) Fail(place, "cannot be read: " + LastHdf5Error());
  std::vector<double> numbers(count * width);
  if (count > 0) ReadTo(place, id, memory, numbers.data());
  *per_row = width;
  return numbers;
}

}  // namespace mvstudio::dataset::internal
