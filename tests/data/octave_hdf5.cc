// The three functions of MATLAB's HDF5 that the writer of captures calls, for Octave.
#include <hdf5.h>
#include <octave/oct.h>

#include <vector>

static hid_t checked(hid_t id) {
    if (id < 0) error("HDF5 refuses");
    return id;
}

static hid_t opened(const std::string& file) {
    H5E_BEGIN_TRY { if (H5Fis_hdf5(file.c_str()) > 0) return H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT); }
    H5E_END_TRY
    return checked(H5Fcreate(file.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT));
}

static hid_t text_type() {
    const hid_t kind = H5Tcopy(H5T_C_S1);
    H5Tset_size(kind, H5T_VARIABLE);
    H5Tset_cset(kind, H5T_CSET_UTF8);
    return kind;
}

static hid_t type_of(const std::string& name) {
    if (name == "double") return H5Tcopy(H5T_NATIVE_DOUBLE);
    if (name == "int8") return H5Tcopy(H5T_NATIVE_INT8);
    if (name == "uint8") return H5Tcopy(H5T_NATIVE_UINT8);
    if (name == "int32") return H5Tcopy(H5T_NATIVE_INT32);
    if (name == "int64") return H5Tcopy(H5T_NATIVE_INT64);
    if (name == "string") return text_type();
    error("h5create: no Datatype %s", name.c_str());
}

DEFUN_DLD(h5create, args, , "h5create (file, name, shape, 'Datatype', class)") {
    const NDArray shape = args(2).array_value();
    std::vector<hsize_t> axes(shape.numel());
    for (octave_idx_type k = 0; k < shape.numel(); ++k) axes[shape.numel() - 1 - k] = shape(k);
    const hid_t file = opened(args(0).string_value()), links = H5Pcreate(H5P_LINK_CREATE);
    H5Pset_create_intermediate_group(links, 1);
    const hid_t kind = type_of(args(4).string_value());
    const hid_t space = H5Screate_simple(axes.size(), axes.data(), nullptr);
    const hid_t made = checked(H5Dcreate2(file, args(1).string_value().c_str(), kind, space, links,
                                          H5P_DEFAULT, H5P_DEFAULT));
    H5Dclose(made), H5Sclose(space), H5Tclose(kind), H5Pclose(links), H5Fclose(file);
    return octave_value_list();
}

DEFUN_DLD(h5write, args, , "h5write (file, name, value)") {
    const hid_t file = opened(args(0).string_value());
    const hid_t made = checked(H5Dopen2(file, args(1).string_value().c_str(), H5P_DEFAULT));
    if (args(2).is_string()) {
        const std::string text = args(2).string_value();
        const char* pointer = text.c_str();
        const hid_t kind = text_type();
        checked(H5Dwrite(made, kind, H5S_ALL, H5S_ALL, H5P_DEFAULT, &pointer));
        H5Tclose(kind);
    } else {
        const NDArray values = args(2).array_value();
        checked(H5Dwrite(made, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
    }
    H5Dclose(made), H5Fclose(file);
    return octave_value_list();
}

DEFUN_DLD(h5writeatt, args, , "h5writeatt (file, place, name, text)") {
    const std::string text = args(3).string_value();
    const hid_t file = opened(args(0).string_value());
    const hid_t place = checked(H5Oopen(file, args(1).string_value().c_str(), H5P_DEFAULT));
    const hid_t kind = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(kind, text.size() + 1);
    const hid_t made = checked(H5Acreate2(place, args(2).string_value().c_str(), kind, space,
                                          H5P_DEFAULT, H5P_DEFAULT));
    checked(H5Awrite(made, kind, text.c_str()));
    H5Aclose(made), H5Sclose(space), H5Tclose(kind), H5Oclose(place), H5Fclose(file);
    return octave_value_list();
}
