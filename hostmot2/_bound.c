/* hostmot2._bound: Python callables for functions of the core that take less time than the interpreter lock takes
 * to be handed over and back. cffi always hands it over; here it is kept. Knows nothing of the core but the
 * shape void f(void *). */
#define Py_LIMITED_API 0x030B0000
#define PY_SSIZE_T_CLEAN
#include <Python.h>

#include <stdint.h>

typedef void bound_function(void *context);

typedef struct binding {
	PyObject_HEAD
	bound_function *function;
	void *context;
	PyObject *owner; /* keeps context alive */
} binding;

static PyObject *binding_call(PyObject *self, PyObject *unused)
{
	binding *bound = (binding *)self;
	(void)unused;
	bound->function(bound->context);
	Py_RETURN_NONE;
}

static PyMethodDef call_method = {"bound", binding_call, METH_NOARGS, "Call the bound function of the core."};

static void binding_free(PyObject *self)
{
	PyTypeObject *type = Py_TYPE(self);
	Py_CLEAR(((binding *)self)->owner);
	PyObject_Free(self);
	Py_DECREF(type);
}

static PyType_Slot binding_slots[] = {{Py_tp_dealloc, (void *)binding_free}, {0, NULL}};
static PyType_Spec binding_spec = {
	"hostmot2._bound.Binding", sizeof(binding), 0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_DISALLOW_INSTANTIATION, binding_slots};

static PyObject *bind(PyObject *module, PyObject *arguments)
{
	unsigned long long function, context;
	PyObject *owner;
	if (!PyArg_ParseTuple(arguments, "KKO:bind", &function, &context, &owner))
		return NULL;
	PyTypeObject **type = PyModule_GetState(module);
	binding *bound = PyObject_New(binding, *type);
	if (!bound)
		return NULL;
	bound->function = (bound_function *)(uintptr_t)function;
	bound->context = (void *)(uintptr_t)context;
	Py_INCREF(owner);
	bound->owner = owner;
	PyObject *callable = PyCFunction_New(&call_method, (PyObject *)bound);
	Py_DECREF(bound);
	return callable;
}

static PyMethodDef methods[] = {
	{"bind", bind, METH_VARARGS,
     "bind(function, context, owner): a callable without arguments that calls the C function at an address with one "
     "pointer, keeping the interpreter lock. It keeps owner alive. Nothing is checked."},
	{NULL, NULL, 0, NULL}};

static int prepare(PyObject *module)
{
	PyTypeObject **type = PyModule_GetState(module);
	*type = (PyTypeObject *)PyType_FromSpec(&binding_spec);
	return *type ? 0 : -1;
}

static void module_free(void *module)
{
	PyTypeObject **type = PyModule_GetState(module);
	if (type)
		Py_CLEAR(*type);
}

static PyModuleDef_Slot slots[] = {{Py_mod_exec, (void *)prepare}, {0, NULL}};
static PyModuleDef definition = {
	.m_base = PyModuleDef_HEAD_INIT,
	.m_name = "hostmot2._bound",
	.m_doc = "Calls into the core that keep the interpreter lock.",
	.m_size = sizeof(PyTypeObject *),
	.m_methods = methods,
	.m_slots = slots,
	.m_free = module_free,
};

PyMODINIT_FUNC PyInit__bound(void)
{
	return PyModuleDef_Init(&definition);
}
