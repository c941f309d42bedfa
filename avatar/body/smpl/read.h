#pragma once

#include <map>
#include <string>

#include "avatar/body/body_template.h"
#include "core/disk/npy.h"

namespace mvstudio::body {

/// A body in the layout of SMPL (Loper et al., SIGGRAPH Asia 2015), SMPL+H or SMPL-X, from a .npz file or a .pkl file, of which
/// nothing is run (dataset/arrays/pickle.h). Throws IoError, FormatError with the array.
BodyTemplate ReadSmpl(const std::string& path);

/// The same from its arrays: v_template (V, 3) metres, f (F, 3), weights (V, B), J_regressor (B, V), kintree_table (2, B);
/// where they are there, shapedirs (V, 3, S) and posedirs (V, 3, 9 (B-1)). B is 24, 52 or 55; the first 22 joints are SMPL's.
///
/// The file's frame has y up, the person faces z. The lowest vertex comes to z = 0 of body, and the shapes are displaced along
/// z so that it stays there: for SMPL's own frame, compare heads of bones. `path` is for messages.
BodyTemplate SmplFromArrays(const std::map<std::string, NpyArray>& arrays, const std::string& path);

/// Those of the arrays above that a .npz or .pkl file has. Throws IoError, FormatError.
std::map<std::string, NpyArray> ReadSmplArrays(const std::string& path);

/// The same arrays as a .npz file for numpy.load and ReadSmpl: indices as int64, all others as float64. What is read again is
/// bit for bit the same. Throws FormatError where SmplFromArrays does; `path` is for messages.
std::string SmplNpz(const std::map<std::string, NpyArray>& arrays, const std::string& path);

}  // namespace mvstudio::body
