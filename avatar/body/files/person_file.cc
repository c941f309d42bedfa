#include "avatar/body/files/person_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "avatar/body/files/person_check.h"
#include "avatar/body/offset_net/offset_net.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/disk/npy_write.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"

namespace mvstudio::body {
namespace {

constexpr const char* kSchema = "mvstudio.body/1";
constexpr const char* kExtra = "extra.";
constexpr const char* kPoseDirections = "pose_directions";  // bodies of SMPL's layout have it
constexpr const char* kOffsetNet = "offset_net.";           // surfaces that a network moves
constexpr size_t kMaxExtraName = 100;

using Members = std::vector<std::pair<std::string, std::string>>;
using Shape = std::vector<int64_t>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

bool IsExtraName(const std::string& name) {
  return !name.empty() && name.size() <= kMaxExtraName &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) { return c < 0x80 && (std::isalnum(c) || c == '_'); });
}

// A matrix of the template holds an element per column: column by column, its numbers are the array's rows.

template <class Matrix>
std::string FloatRows(const Matrix& values, std::vector<size_t> shape) {
  return NpyOfFloats(shape, std::vector<float>(values.data(), values.data() + values.size()));
}

std::string DoubleRows(const Eigen::Matrix3Xd& values) {
  return NpyOfDoubles({static_cast<size_t>(values.cols()), 3},
                      std::vector<double>(values.data(), values.data() + values.size()));
}

template <class Values>
std::string IntRows(const Values& values, std::vector<size_t> shape) {
  return NpyOfInts(shape, std::vector<int64_t>(values.data(), values.data() + values.size()));
}

std::vector<int> RoleNumbers(const BodyTemplate& body) {
  std::vector<int> numbers;
  for (const BoneRole role : body.bone_roles) numbers.push_back(static_cast<int>(role));
  return numbers;
}

Members MembersOf(const BodyTemplate& body) {
  const auto vertices = static_cast<size_t>(body.vertices.cols()), faces = static_cast<size_t>(body.faces.cols());
  Members members = {{"schema", NpyOfTexts({kSchema})},
                     {"vertices", FloatRows(body.vertices, {vertices, 3})},
                     {"faces", IntRows(body.faces, {faces, 3})},
                     {"face_part", IntRows(body.face_part, {faces})},
                     {"face_uv", FloatRows(body.face_uv, {faces, 3, 2})},
                     {"bone_names", NpyOfTexts(body.bone_names)},
                     {"bone_roles", IntRows(RoleNumbers(body), {body.bone_roles.size()})},
                     {"bone_parents", IntRows(body.bone_parents, {body.bone_parents.size()})},
                     {"bone_heads", DoubleRows(body.bone_heads)},
                     {"bone_tails", DoubleRows(body.bone_tails)},
                     {"skin_bones", IntRows(body.skin_bones, {vertices, 4})},
                     {"skin_weights", FloatRows(body.skin_weights, {vertices, 4})},
                     {"coco19", DoubleRows(body.coco19)},
                     {"coco19_bone", IntRows(body.coco19_bone, {19})}};
  if (body.pose_directions.size() > 0)
    members.emplace_back(kPoseDirections,
                         FloatRows(body.pose_directions, {static_cast<size_t>(body.pose_directions.cols()), vertices, 3}));
  if (body.moving_offsets) {
    for (const auto& [name, array] : dynamic_cast<const OffsetNet&>(*body.moving_offsets).arrays())
      members.emplace_back(kOffsetNet + name, NpyOfFloats({array.shape.begin(), array.shape.end()}, array.values));
  }
  return members;
}

/// The arrays of a file; each is taken once.
class Arrays {
 public:
  Arrays(const std::string& bytes, const std::string& path) : path_(path), members_(dataset::ParseNpzMembers(bytes, path)) {}

  [[noreturn]] void Refuse(const std::string& name, const std::string& what) const { throw FormatError(path_, name, what); }

  bool Has(const std::string& name) const { return members_.count(name) > 0; }

  std::vector<std::string> Texts(const std::string& name) { return ParseNpyTexts(Take(name), path_ + ": " + name); }

  /// Array of this shape, -1 for any number of rows; its numbers row by row.
  std::vector<double> Numbers(const std::string& name, Shape shape) {
    NpyArray array = ParseNpy(Take(name), path_ + ": " + name);
    if (array.shape.size() == shape.size() && shape[0] < 0) shape[0] = array.shape[0];
    if (array.shape != shape) Refuse(name, "has another shape than a body's");
    if (array.shape[0] > std::numeric_limits<int>::max() / 16) Refuse(name, "is too large");
    return std::move(array.values);
  }

  /// One column per row of the array. `Matrix` has as many rows as the array has numbers in a row, or in a corner of a face.
  template <class Matrix>
  Matrix Columns(const std::string& name, const Shape& shape) {
    using Scalar = typename Matrix::Scalar;
    const std::vector<double> values = Numbers(name, shape);
    Matrix matrix(static_cast<Eigen::Index>(Matrix::RowsAtCompileTime),
                  static_cast<Eigen::Index>(values.size()) / Matrix::RowsAtCompileTime);
    for (size_t i = 0; i < values.size(); ++i)
      matrix(static_cast<Eigen::Index>(i)) = static_cast<Scalar>(Checked(name, values[i], std::is_integral_v<Scalar>));
    return matrix;
  }

  std::vector<int> Ints(const std::string& name, const Shape& shape) {
    std::vector<int> ints;
    for (const double value : Numbers(name, shape)) ints.push_back(static_cast<int>(Checked(name, value, true)));
    return ints;
  }

  /// Those of a network of offsets; its problems are the file's. Null: there are none.
  std::shared_ptr<const MovingOffsets> Network(const BodyTemplate& body) {
    NetArrays arrays;
    const std::string prefix = kOffsetNet;
    for (auto at = members_.lower_bound(prefix); at != members_.end() && at->first.compare(0, prefix.size(), prefix) == 0;) {
      const NpyArray array = ParseNpy(at->second, path_ + ": " + at->first);
      arrays[at->first.substr(prefix.size())] = {array.shape, {array.values.begin(), array.values.end()}};
      at = members_.erase(at);
    }
    if (arrays.empty()) return nullptr;
    if (const auto problem = ProblemOf(arrays)) Refuse(kOffsetNet + problem->array, problem->what);
    return std::make_shared<OffsetNet>(body, std::move(arrays));
  }

  /// What is left: extras, and nothing else.
  std::map<std::string, Eigen::MatrixXd> Extras() {
    std::map<std::string, Eigen::MatrixXd> extras;
    const std::string prefix = kExtra;
    for (const auto& [name, bytes] : members_) {
      const std::string stem = name.compare(0, prefix.size(), prefix) == 0 ? name.substr(prefix.size()) : "";
      if (!IsExtraName(stem)) Refuse(name, "is not known; arrays of other programs are called extra.NAME");
      const NpyArray array = ParseNpy(bytes, path_ + ": " + name);
      if (array.shape.size() != 2) Refuse(name, "is no matrix");
      for (const int64_t size : array.shape) {
        if (size > std::numeric_limits<int>::max()) Refuse(name, "is too large");
      }
      extras[stem] = Eigen::Map<const Rows>(array.values.data(), array.shape[0], array.shape[1]);
    }
    return extras;
  }

 private:
  std::string Take(const std::string& name) {
    auto member = members_.extract(name);
    if (member.empty()) Refuse(name, "is missing");
    return std::move(member.mapped());
  }

  /// What can be converted; whether a number is right for a body is asked later.
  double Checked(const std::string& name, double value, bool whole) const {
    const double most = whole ? std::numeric_limits<int>::max() : internal::kMaxCoordinate;
    if (!(std::abs(value) <= most)) Refuse(name, "holds a number that is not finite or too large");
    if (whole && value != std::floor(value)) Refuse(name, "holds a number that is not whole");
    return value;
  }

  std::string path_;
  std::map<std::string, std::string> members_;
};

BodyTemplate BodyFrom(Arrays* arrays) {
  BodyTemplate body;
  body.vertices = arrays->Columns<Eigen::Matrix3Xf>("vertices", {-1, 3});
  body.faces = arrays->Columns<Eigen::Matrix3Xi>("faces", {-1, 3});
  body.face_part = arrays->Ints("face_part", {-1});
  body.face_uv = arrays->Columns<Eigen::Matrix2Xf>("face_uv", {-1, 3, 2});
  body.bone_names = arrays->Texts("bone_names");
  for (const int role : arrays->Ints("bone_roles", {-1})) body.bone_roles.push_back(static_cast<BoneRole>(role));
  body.bone_parents = arrays->Ints("bone_parents", {-1});
  body.bone_heads = arrays->Columns<Eigen::Matrix3Xd>("bone_heads", {-1, 3});
  body.bone_tails = arrays->Columns<Eigen::Matrix3Xd>("bone_tails", {-1, 3});
  body.skin_bones = arrays->Columns<Eigen::Matrix4Xi>("skin_bones", {-1, 4});
  body.skin_weights = arrays->Columns<Eigen::Matrix4Xf>("skin_weights", {-1, 4});
  body.coco19 = arrays->Columns<Eigen::Matrix3Xd>("coco19", {19, 3});
  const std::vector<int> bones = arrays->Ints("coco19_bone", {19});
  std::copy(bones.begin(), bones.end(), body.coco19_bone.begin());
  if (arrays->Has(kPoseDirections)) {
    const std::vector<double> values = arrays->Numbers(kPoseDirections, {-1, body.vertices.cols(), 3});
    body.pose_directions =
        Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()))
            .cast<float>()
            .reshaped(3 * body.vertices.cols(), static_cast<Eigen::Index>(values.size()) / (3 * body.vertices.cols()));
  }
  return body;
}

}  // namespace

std::string PersonFileBytes(const PersonFile& person) {
  const auto problem = internal::ProblemOf(person.body);
  MVS_CHECK(!problem, problem->array << ": " << problem->what);
  Members members = MembersOf(person.body);
  for (const auto& [name, matrix] : person.extras) {
    MVS_CHECK(IsExtraName(name), "an extra array is called '" << name << "'");
    const Rows rows = matrix;
    members.emplace_back(kExtra + name, NpyOfDoubles({static_cast<size_t>(rows.rows()), static_cast<size_t>(rows.cols())},
                                                     std::vector<double>(rows.data(), rows.data() + rows.size())));
  }
  return NpzOf(members);
}

void WritePersonFile(const std::string& path, const PersonFile& person) { WriteFileAtomic(path, PersonFileBytes(person)); }

PersonFile ParsePersonFile(const std::string& bytes, const std::string& path) {
  Arrays arrays(bytes, path);
  const std::vector<std::string> schema = arrays.Texts("schema");
  if (schema != std::vector<std::string>{kSchema}) arrays.Refuse("schema", std::string("is not '") + kSchema + "'");
  PersonFile person;
  person.body = BodyFrom(&arrays);
  if (const auto problem = internal::ProblemOf(person.body)) arrays.Refuse(problem->array, problem->what);
  person.body.moving_offsets = arrays.Network(person.body);
  person.extras = arrays.Extras();
  return person;
}

PersonFile ReadPersonFile(const std::string& path) { return ParsePersonFile(ReadFile(path), path); }

}  // namespace mvstudio::body
