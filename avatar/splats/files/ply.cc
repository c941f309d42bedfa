#include "avatar/splats/files/ply.h"

#include <cmath>
#include <cstring>
#include <map>
#include <sstream>

#include "avatar/splats/splat_view.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::splats {
namespace {

constexpr size_t kMaxHeaderBytes = 1 << 16;

/// Names of the attributes in the order that the reference program writes them.
std::vector<std::string> Names(int degree) {
  std::vector<std::string> names = {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (int k = 0; k < 3 * (BasisSize(degree) - 1); ++k) names.push_back("f_rest_" + std::to_string(k));
  names.push_back("opacity");
  for (int k = 0; k < 3; ++k) names.push_back("scale_" + std::to_string(k));
  for (int k = 0; k < 4; ++k) names.push_back("rot_" + std::to_string(k));
  return names;
}

void AddFloats(const float* values, size_t n, std::string* out) {
  static_assert(sizeof(float) == 4, "the file holds IEEE single precision, as little-endian machines have it");
  out->append(reinterpret_cast<const char*>(values), n * sizeof(float));
}

struct Header {
  size_t count = 0, begin = 0;     // Gaussians; first byte of their numbers
  std::vector<std::string> names;  // of the floats of each
};

[[noreturn]] void Refuse(const std::string& path, const std::string& where, const std::string& what) {
  throw FormatError(path, where, what);
}

size_t CountOf(const std::string& path, const std::string& text) {
  if (text.empty() || text.size() > 10 || text.find_first_not_of("0123456789") != std::string::npos)
    Refuse(path, "header", "'" + text + "' is not a number of vertices");
  return std::stoull(text);
}

void ReadHeaderLine(const std::string& path, const std::string& line, bool* in_vertex, Header* header) {
  std::istringstream words(line);
  std::string word, type, name, more;
  words >> word;
  if (word == "comment" || word == "obj_info") return;
  if (word == "format") {
    words >> type;
    if (type != "binary_little_endian") Refuse(path, "header", "format '" + type + "' is not binary_little_endian");
  } else if (word == "element") {
    words >> type >> more;
    if (type != "vertex" || *in_vertex) Refuse(path, "header", "element '" + type + "' is none of Gaussians: vertex alone");
    *in_vertex = true, header->count = CountOf(path, more);
  } else if (word == "property") {
    words >> type >> name;
    if (!*in_vertex || type != "float" || name.empty())
      Refuse(path, "header", "property '" + type + " " + name + "' is not a float of a vertex");
    header->names.push_back(name);
  } else {
    Refuse(path, "header", "'" + word + "' is not known");
  }
}

Header ReadHeader(const std::string& bytes, const std::string& path) {
  const std::string end_mark = "end_header\n";
  const size_t end = bytes.substr(0, kMaxHeaderBytes).find(end_mark);
  if (bytes.compare(0, 4, "ply\n") != 0 || end == std::string::npos) Refuse(path, "header", "is not that of a PLY file");
  Header header;
  header.begin = end + end_mark.size();
  std::istringstream lines(bytes.substr(4, end - 4));
  std::string line;
  bool in_vertex = false, format = false;
  while (std::getline(lines, line)) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    format = format || line.compare(0, 6, "format") == 0;
    ReadHeaderLine(path, line, &in_vertex, &header);
  }
  if (!in_vertex || !format) Refuse(path, "header", "names no format, or no vertices");
  const size_t width = header.names.size() * sizeof(float), rest = bytes.size() - header.begin;
  if (width == 0 || header.count > rest / width || header.count * width != rest)
    Refuse(path, "vertex",
           std::to_string(header.count) + " vertices of " + std::to_string(width) + " bytes, but " + std::to_string(rest) +
               " bytes follow");
  return header;
}

/// Where an attribute stands among the floats of a vertex.
size_t Column(const std::string& path, const std::map<std::string, size_t>& columns, const std::string& name) {
  const auto found = columns.find(name);
  if (found == columns.end()) Refuse(path, "vertex", "attribute " + name + " is missing");
  return found->second;
}

int DegreeOf(const std::string& path, const std::map<std::string, size_t>& columns, size_t* rest) {
  *rest = 0;
  while (columns.count("f_rest_" + std::to_string(*rest))) ++*rest;
  for (int degree = 0; degree <= 3; ++degree)
    if (*rest == static_cast<size_t>(3 * (BasisSize(degree) - 1))) return std::min(degree, kMaxDegree);
  Refuse(path, "vertex", std::to_string(*rest) + " attributes f_rest are none of degrees 0 to 3");
}

}  // namespace

std::string PlyBytes(const PlySplats& s) {
  const size_t n = s.size(), basis = static_cast<size_t>(BasisSize(s.degree));
  MVS_CHECK(s.xyz.size() == 3 * n && s.normal.size() == 3 * n && s.colour.size() == 3 * basis * n &&
                s.log_scale.size() == 3 * n && s.rotation.size() == 4 * n,
            "arrays of different lengths for " << n << " Gaussians");
  std::string out = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(n) + "\n";
  for (const std::string& name : Names(s.degree)) out += "property float " + name + "\n";
  out += "end_header\n";
  for (size_t i = 0; i < n; ++i) {
    AddFloats(&s.xyz[3 * i], 3, &out);
    AddFloats(&s.normal[3 * i], 3, &out);
    AddFloats(&s.colour[3 * basis * i], 3 * basis, &out);
    AddFloats(&s.opacity[i], 1, &out);
    AddFloats(&s.log_scale[3 * i], 3, &out);
    AddFloats(&s.rotation[4 * i], 4, &out);
  }
  return out;
}

PlySplats ParsePly(const std::string& bytes, const std::string& path) {
  const Header header = ReadHeader(bytes, path);
  std::map<std::string, size_t> columns;
  for (size_t k = 0; k < header.names.size(); ++k)
    if (!columns.emplace(header.names[k], k).second) Refuse(path, "header", "attribute " + header.names[k] + " is there twice");
  PlySplats out;
  size_t rest = 0;
  out.degree = DegreeOf(path, columns, &rest);
  const size_t basis = static_cast<size_t>(BasisSize(out.degree));
  std::vector<size_t> from;  // columns in our order
  for (std::string name : Names(out.degree)) {
    if (name.compare(0, 7, "f_rest_") == 0) {  // a channel's coefficients of higher degrees follow those that are kept
      const size_t k = std::stoul(name.substr(7)), kept = basis - 1;
      name = "f_rest_" + std::to_string(k / kept * (rest / 3) + k % kept);
    }
    from.push_back(Column(path, columns, name));
  }
  std::vector<float> row(header.names.size());
  const auto take = [&](size_t first, size_t count, std::vector<float>* to) {
    for (size_t k = 0; k < count; ++k) to->push_back(row[from[first + k]]);
  };
  for (size_t i = 0; i < header.count; ++i) {
    std::memcpy(row.data(), bytes.data() + header.begin + i * row.size() * sizeof(float), row.size() * sizeof(float));
    for (const size_t column : from)
      if (!std::isfinite(row[column]))
        Refuse(path, "vertex " + std::to_string(i), header.names[column] + " is not a finite number");
    take(0, 3, &out.xyz), take(3, 3, &out.normal), take(6, 3 * basis, &out.colour);
    take(6 + 3 * basis, 1, &out.opacity), take(7 + 3 * basis, 3, &out.log_scale), take(10 + 3 * basis, 4, &out.rotation);
  }
  return out;
}

void WritePly(const PlySplats& splats, const std::string& path) { WriteFileAtomic(path, PlyBytes(splats)); }
PlySplats ReadPly(const std::string& path) { return ParsePly(ReadFile(path), path); }

PlySplats ToPly(const Cloud& cloud, const Eigen::Matrix3Xi& faces, const Eigen::Matrix3Xf& vertices) {
  CheckCloud(cloud, static_cast<int>(faces.cols()));
  PlySplats out;
  out.degree = cloud.values.degree;
  const auto basis = static_cast<size_t>(BasisSize(out.degree));
  for (size_t i = 0; i < cloud.size(); ++i) {
    SplatView<float> s;
    s.placed = PlaceSplat(cloud, i, {faces, vertices});
    if (s.placed.status != Status::kOk) continue;
    SmoothScales(cloud, i, &s);
    const float opacity = s.kept / (1 + std::exp(-cloud.values.opacity[i]));
    const Eigen::Vector4f q = Eigen::Map<const Eigen::Vector4f>(cloud.values.rotation.data() + 4 * i).normalized();
    const Eigen::Matrix3f own = s.placed.world_from_face * MatrixOf<float>(q);
    const float logit = std::log(opacity) - std::log1p(-opacity);
    if (!std::isfinite(logit) || !own.allFinite() || !s.scale.allFinite()) continue;
    const Eigen::Quaternionf turn(own);
    for (int k = 0; k < 3; ++k) {
      out.xyz.push_back(s.placed.mean[k]), out.normal.push_back(s.placed.world_from_face(k, 2));
      out.log_scale.push_back(std::log(s.scale[k]));
    }
    for (const float v : {turn.w(), turn.x(), turn.y(), turn.z()}) out.rotation.push_back(v);
    out.opacity.push_back(logit);
    double rotated[3][BasisSize(kMaxDegree)];
    for (size_t c = 0; c < 3; ++c) {
      double own_colour[BasisSize(kMaxDegree)];
      for (size_t k = 0; k < basis; ++k) own_colour[k] = cloud.values.colour[3 * (i * basis + k) + c];
      RotateCoefficients(s.placed.world_from_face.cast<double>(), out.degree, own_colour, rotated[c]);
    }
    for (size_t c = 0; c < 3; ++c) out.colour.push_back(static_cast<float>(rotated[c][0]));
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 1; k < basis; ++k) out.colour.push_back(static_cast<float>(rotated[c][k]));
  }
  return out;
}

}  // namespace mvstudio::splats
